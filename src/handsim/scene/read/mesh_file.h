// Convex meshes from OBJ and STL files.
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "handsim/core/pose.h"
#include "handsim/model/convex_mesh.h"

namespace handsim::scene {

/// Points and the polygons between them.
struct Surface {
  std::vector<Vec3> vertices;
  std::vector<std::vector<int>> faces;
};

/// Vertices and planar faces of the hull, counter-clockwise seen from outside. Thread-safe. @param points
/// finite, at least 4. @throws Error (input) if they span no volume
Surface convex_hull(const std::vector<Vec3>& points);

/// A convex mesh and the position of its centroid in the file's coordinates.
struct LoadedMesh {
  std::shared_ptr<const model::ConvexMesh> mesh;
  Vec3 centroid = Vec3::Zero();  ///< scaled [m]
  int open_edges = 0;            ///< edges that are not shared by exactly two faces of the file
};

/// Reads the surface of a convex body and keeps the corners of its hull. Errors: surface further inside the
/// hull than 1e-4 of its size, more than 1e-3 of the hull's area without a face, a flat mesh, numbers that
/// are not finite, more than 100000 triangles or 1000 corners. @param scale of the file's unit [m]
/// @throws Error (input); if the mesh's file cannot be read, with the place in it, otherwise without a place.
LoadedMesh load_convex_mesh(const std::filesystem::path& path, double scale);

/// The polygons of an OBJ or STL file (text or binary, by its size), in its unit; opens no other file. OBJ:
/// `v`, `f` (negative indices, too); groups, materials, normals, textures, points and lines are ignored.
/// @throws Error (input) with the place in the file: an unknown statement, an invalid number, a face of fewer
/// than three corners, an incomplete file, or one above 64 MB or 100000 triangles
Surface read_surface_file(const std::filesystem::path& path);

}  // namespace handsim::scene
