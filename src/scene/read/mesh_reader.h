// Reads the polygons of OBJ and STL files, in the file's unit. Reads nothing else of these formats and opens
// no other file. Limits: 64 MB, 100000 triangles.
#pragma once

#include <filesystem>

#include "handsim/scene/read/convex_hull.h"

namespace handsim::scene {

/// OBJ: `v` and `f` (negative indices, too); groups, materials, normals, textures, points and lines are
/// ignored. STL: text or binary, recognised by the file's size.
/// @throws Error (input) with the place in the mesh's file: an unknown statement, an invalid number, a face
/// of fewer than three corners, an incomplete or too large file.
Surface read_surface_file(const std::filesystem::path& path);

}  // namespace handsim::scene
