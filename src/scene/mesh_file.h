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
};

/// Reads the surface of a convex body. Its corners are kept as they are; what makes it no convex body is an
/// error: surface further inside the hull than 1e-4 of its size, no extent, numbers that are not finite, more
/// than 100000 faces or 1000 corners.
/// @param scale of the file's unit [m].
/// @throws Error (input) without a place, whose problem says what was found and what was needed.
LoadedMesh load_convex_mesh(const std::filesystem::path& path, double scale);

}  // namespace handsim::scene
