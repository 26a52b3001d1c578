// Reads the surface of skin, objects, ground and named materials.
#pragma once

#include <string>

#include "handsim/core/yaml_reader.h"
#include "handsim/model/material.h"

namespace handsim::hand {

/// The keys of Material::fields, and `spread`, which studies of uncertainty read.
model::Material read_material(MapReader& reader, std::string name);

}  // namespace handsim::hand
