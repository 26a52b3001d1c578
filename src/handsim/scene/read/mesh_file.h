// Convex meshes from OBJ and STL files.
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "handsim/core/pose.h"
#include "handsim/model/convex_mesh.h"
#include "handsim/scene/read/mesh_reader.h"

namespace handsim::scene {

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

}  // namespace handsim::scene
