// Object files: the shapes, mass, surface and source of a thing, without a place in the world. A scene's
// object names one under `file`, and its own keys go before the file's.
#pragma once

#include "handsim/scene/read/scene_spec.h"

namespace handsim::scene {

/// Reads an object file as it stands, as an object of its own at the world's origin.
ObjectSpec read_object_file(YamlNode& root, Diagnostics& diagnostics);

}  // namespace handsim::scene
