// The compliance of a surface: a spring, an exponential or a table of force over depth, with a damper, with
// parts that relax, and scaled by the size of the shape.
#pragma once

#include "handsim/core/yaml_reader.h"
#include "handsim/model/model.h"

namespace handsim::hand {

/// Reads `stiffness`, `damping`, `exponential`, `table`, `relaxation`, `reference_radius`, `spinning_friction`
/// and `friction_over_load` into the material.
void read_pad(MapReader& reader, model::Material& material);

}  // namespace handsim::hand
