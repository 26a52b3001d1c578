// The polygons of OBJ and STL files.
#pragma once

#include <filesystem>
#include <vector>

#include "handsim/core/pose.h"

namespace handsim::scene {

/// Points and the polygons between them.
struct Surface {
  std::vector<Vec3> vertices;
  std::vector<std::vector<int>> faces;
};

/// The polygons of an OBJ or STL file (text or binary, by its size), in its unit; opens no other file. OBJ:
/// `v`, `f` (negative indices, too); groups, materials, normals, textures, points and lines are ignored.
/// @throws Error (input) with the place in the file: an unknown statement, an invalid number, a face of fewer
/// than three corners, an incomplete file, or one above 64 MB or 100000 triangles
Surface read_surface_file(const std::filesystem::path& path);

}  // namespace handsim::scene
