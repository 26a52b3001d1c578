// Reads the surface of skin, objects, ground and named materials.
#pragma once

#include <string>

#include "handsim/core/yaml_reader.h"
#include "handsim/model/material.h"

namespace handsim::model {

/// The keys of Material::fields, those of a law that is more than a spring and a damper (an exponential or a
/// table of force over depth, parts that relax, the size that it is of, friction by area and load), and
/// `spread`, which studies of uncertainty read.
Material read_material(MapReader& reader, std::string name);

}  // namespace handsim::model
