// The files that a compiled scene was read from: scene, persons, hand models, meshes, motions.
#pragma once

#include <filesystem>
#include <vector>

#include "handsim/scene/compile/scene.h"

namespace handsim::scene {

/// Each once, as the resolved scene names them.
std::vector<std::filesystem::path> files_read(const Scene& scene);

}  // namespace handsim::scene
