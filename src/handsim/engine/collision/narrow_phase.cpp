#include "handsim/engine/collision/narrow_phase.h"

#include <array>
#include <map>
#include <mutex>

#include "handsim/engine/collision/polytope.h"

namespace handsim::engine {

using model::ShapeKind;

namespace {

/// The polyhedron of a box. Models of thousands of environments have the same ones.
std::shared_ptr<const model::ConvexMesh> shared_box(const Vec3& edges) {
  using Key = std::array<double, 3>;
  static std::mutex mutex;
  static std::map<Key, std::weak_ptr<const model::ConvexMesh>> known;
  const std::lock_guard lock(mutex);
  const Key key = {edges.x(), edges.y(), edges.z()};
  if (const auto found = known.find(key); found != known.end())
    if (auto box = found->second.lock()) return box;
  std::erase_if(known, [](const auto& each) { return each.second.expired(); });
  auto box = std::make_shared<const model::ConvexMesh>(model::box_polyhedron(edges));
  known[key] = box;
  return box;
}

}  // namespace

NarrowPhase::NarrowPhase(const model::Model& model) : model_(model) {
  boxes_.resize(model.shapes.size());
  for (std::size_t i = 0; i < boxes_.size(); ++i)
    if (model.shapes[i].kind == ShapeKind::box) boxes_[i] = shared_box(model.shapes[i].edges);
}

/// With normals out of b into a; false where only the pair the other way round may be known.
bool NarrowPhase::in_order(std::size_t index_a, const Pose& x_WA, std::size_t index_b, const Pose& x_WB,
                           std::optional<Manifold>& out) const {
  const model::Shape &a = model_.shapes[index_a], &b = model_.shapes[index_b];
  if (a.kind == ShapeKind::capsule) {
    const CapsuleAt capsule{x_WA, a.radius, a.length};
    if (b.kind == ShapeKind::box) out = capsule_on_box(capsule, x_WB, b.edges);
    if (b.kind == ShapeKind::cylinder) out = capsule_on_cylinder(capsule, x_WB, b.radius, b.length);
    if (b.kind == ShapeKind::convex_mesh) out = capsule_on_mesh(capsule, x_WB, *b.mesh);
  } else if (a.kind == ShapeKind::sphere) {
    if (b.kind == ShapeKind::convex_mesh) out = capsule_on_mesh({x_WA, a.radius, 0}, x_WB, *b.mesh);
  } else if (a.kind == ShapeKind::convex_mesh) {
    if (b.kind == ShapeKind::plane) out = mesh_on_plane(*a.mesh, x_WA, x_WB);
    if (b.kind == ShapeKind::convex_mesh) out = mesh_on_mesh(*a.mesh, x_WA, *b.mesh, x_WB);
    if (b.kind == ShapeKind::box) out = mesh_on_mesh(*a.mesh, x_WA, *boxes_[index_b], x_WB);
  }
  return out.has_value();
}

bool NarrowPhase::polyhedral(std::size_t shape) const {
  return model_.shapes[shape].kind == ShapeKind::box || model_.shapes[shape].kind == ShapeKind::convex_mesh;
}

/// Rigid boxes have ODE's points.
std::optional<Manifold> NarrowPhase::manifold(std::size_t a, const Pose& x_WA, std::size_t b,
                                              const Pose& x_WB, bool pad) const {
  if (pad && boxes_[a] && boxes_[b]) return mesh_on_mesh(*boxes_[a], x_WA, *boxes_[b], x_WB, true);
  std::optional<Manifold> found;
  if (!in_order(a, x_WA, b, x_WB, found) && in_order(b, x_WB, a, x_WA, found))
    for (int i = 0; i < found->count; ++i) {
      Vec3& normal = found->points[as_index(i)].normal;
      normal = -normal;
    }
  return found;
}

}  // namespace handsim::engine
