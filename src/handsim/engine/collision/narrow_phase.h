// Which pairs of shapes have contact manifolds of handsim's own; the others are the engine's to test.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "handsim/engine/collision/manifold.h"
#include "handsim/engine/collision/ode_library.h"
#include "handsim/model/model.h"

namespace handsim::engine {

inline constexpr int kMaxPairContacts = 8;  ///< Contact points that one pair of shapes can have.

/// Calls add(position, normal, depth) for ODE's contact points of two geoms, world, normals out of b into a.
/// A point without a normal is left out: libccd, which ODE asks about cylinders and meshes, gives one where
/// surfaces touch at a depth of 0 to rounding. A step later they are deeper, and the point has its normal.
/// @return the number of points. @throws OdeFault
template <class Add>
int add_ode_points(dGeomID a, dGeomID b, const Add& add) {
  std::array<dContactGeom, kMaxPairContacts> found;
  const int found_count = dCollide(a, b, kMaxPairContacts, found.data(), sizeof(dContactGeom));
  int count = 0;
  for (int i = 0; i < found_count; ++i) {
    const dContactGeom& point = found[as_index(i)];
    const Vec3 normal(point.normal[0], point.normal[1], point.normal[2]);
    // Written so that NaN fails.
    if (!(normal.squaredNorm() > 0.5)) continue;
    add(Vec3(point.pos[0], point.pos[1], point.pos[2]), normal, point.depth);
    ++count;
  }
  return count;
}

/// The model's shapes, and polyhedra of its boxes.
class NarrowPhase {
 public:
  /// The model must outlive this object.
  explicit NarrowPhase(const model::Model& model);

  /// Contact points of two shapes, normals out of b into a, if the pair has a manifold of its own: capsules
  /// on boxes, cylinders and convex meshes, convex meshes on all but cylinders, boxes on boxes with a pad.
  /// @param x_WA, x_WB poses of the shapes' frames; @param pad the surfaces are compliant
  std::optional<Manifold> manifold(std::size_t a, const Pose& x_WA, std::size_t b, const Pose& x_WB,
                                   bool pad = false) const;
  /// Boxes and meshes have flat faces, on which points come and go as they tilt.
  bool flat(std::size_t a, std::size_t b) const { return polyhedral(a) && polyhedral(b); }

 private:
  bool in_order(std::size_t a, const Pose& x_WA, std::size_t b, const Pose& x_WB,
                std::optional<Manifold>& out) const;
  bool polyhedral(std::size_t shape) const;

  const model::Model& model_;
  std::vector<std::shared_ptr<const model::ConvexMesh>> boxes_;  ///< as Model::shapes; null: no box
};

}  // namespace handsim::engine
