// Meshes from OBJ and STL files, for shapes that are convex.
#pragma once

#include <filesystem>
#include <memory>

#include "handsim/model/convex_mesh.h"

namespace handsim::scene {

/// A convex mesh and where its centroid lies in the file's coordinates.
struct LoadedMesh {
  std::shared_ptr<const model::ConvexMesh> mesh;
  Vec3 centroid = Vec3::Zero();  ///< scaled [m]
  int odd_edges = 0;             ///< of the file's faces, not shared by exactly two: no closed surface
};

/// Reads the surface of a convex body. Its corners are kept as they are; what makes it no convex body is an
/// error: surface further inside the hull than 1e-4 of its size, more than 1e-3 of the hull's area without a
/// face, no extent, numbers that are not finite, more than 100000 triangles or 1000 corners.
/// @param scale of the file's unit [m].
/// @throws Error (input) with what was found and what was needed; with the place in the mesh's file
/// where that cannot be read, otherwise without one.
LoadedMesh load_convex_mesh(const std::filesystem::path& path, double scale);

}  // namespace handsim::scene
