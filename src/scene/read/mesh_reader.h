// Faces of OBJ and STL files as they stand there; nothing else of these formats is read, and no other file is
// opened. Bounded: a file of 64 MB, 100000 triangles.
#pragma once

#include <filesystem>
#include <vector>

#include "handsim/core/pose.h"

namespace handsim::scene {

/// Polygons in the order of the file, in its unit.
struct FileSurface {
  std::vector<Vec3> points;
  std::vector<int> corners;  ///< into points, face after face
  std::vector<int> starts;   ///< of each face in corners, then corners.size()

  std::size_t faces() const { return starts.size() - 1; }
};

/// OBJ: `v` and `f` (negative indices too); groups, materials, normals, textures, points and lines are left
/// out. STL: text or binary, which its size tells.
/// @throws Error (input) with the place in the mesh's file: an unknown statement, a number that is none, a
/// face
///         of fewer than three corners, a file that is torn or too large.
FileSurface read_surface_file(const std::filesystem::path& path);

}  // namespace handsim::scene
