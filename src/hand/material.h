// Reads the surface of a thing: skin, objects, ground, named materials of a scene.
#pragma once

#include <string>

#include "handsim/core/yaml_reader.h"
#include "handsim/model/model.h"

namespace handsim::hand {

/// Keys `friction`, `restitution`, `restitution_speed`, `stiffness`, `damping`, `rolling_friction`,
/// `spinning_friction` of a mapping that may have others.
model::Material read_material(MapReader& reader, std::string name);

}  // namespace handsim::hand
