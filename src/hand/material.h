// Reads the surface properties of skin, objects, ground and named materials of a scene.
#pragma once

#include <string>

#include "handsim/core/yaml_reader.h"
#include "handsim/model/model.h"

namespace handsim::hand {

/// Keys `friction`, `restitution`, `restitution_speed`, `stiffness`, `damping`, `rolling_friction`,
/// `spinning_friction`; the mapping may have others.
model::Material read_material(MapReader& reader, std::string name);

}  // namespace handsim::hand
