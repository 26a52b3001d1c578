// Polygons of OBJ and STL files as they stand there, in the file's unit; nothing else of these formats is
// read, and no other file is opened. Bounded: a file of 64 MB, 100000 triangles.
#pragma once

#include <filesystem>

#include "handsim/scene/read/convex_hull.h"

namespace handsim::scene {

/// OBJ: `v` and `f` (negative indices too); groups, materials, normals, textures, points and lines are left
/// out. STL: text or binary, which its size decides.
/// @throws Error (input) with the place in the mesh's file: an unknown statement, a number that is none, a
/// face of fewer than three corners, a file that is torn or too large.
Surface read_surface_file(const std::filesystem::path& path);

}  // namespace handsim::scene
