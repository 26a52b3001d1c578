// The law of a surface that is more than a spring and a damper: an exponential or a table of force over
// depth, parts that relax, the size that it is of, and friction by area and load.
#pragma once

#include "handsim/core/yaml_reader.h"
#include "handsim/model/material.h"

namespace handsim::hand {

/// Reads `exponential`, `table`, `relaxation`, `reference_radius`, `spins_by_area` and `friction_over_load`
/// into a material that has its fields, and checks them and `damping` against these.
void read_pad_law(MapReader& reader, model::Material& material);

}  // namespace handsim::hand
