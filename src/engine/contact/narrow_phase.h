// Which pairs of shapes have contact manifolds of handsim's own; the others are the engine's to test.
#pragma once

#include <optional>
#include <vector>

#include "handsim/engine/contact/manifold.h"
#include "handsim/model/model.h"

namespace handsim::engine {

/// The model's shapes, and polyhedra of its boxes where meshes may meet them.
class NarrowPhase {
 public:
  /// The model must outlive this.
  explicit NarrowPhase(const model::Model& model);

  /// Contact points of two shapes, normals out of b into a; nothing for a pair without a manifold of its own:
  /// capsules on boxes, cylinders and convex meshes, and convex meshes on all but cylinders have one.
  /// @param x_WA, x_WB poses of the shapes' frames
  std::optional<Manifold> manifold(std::size_t a, const Pose& x_WA, std::size_t b, const Pose& x_WB) const;

 private:
  std::optional<Manifold> in_order(std::size_t a, const Pose& x_WA, std::size_t b, const Pose& x_WB) const;

  const model::Model& model_;
  std::vector<std::optional<model::ConvexMesh>> boxes_;  ///< as Model::shapes; none: empty
};

}  // namespace handsim::engine
