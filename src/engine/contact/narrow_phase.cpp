#include "handsim/engine/contact/narrow_phase.h"

#include "handsim/engine/contact/polytope.h"

namespace handsim::engine {

namespace {

using model::ShapeKind;

/// With normals out of b into a; nothing where only the pair turned round may be known.
std::optional<Manifold> in_order(const model::Shape& a, const Pose& x_WA, const model::Shape& b,
                                 const Pose& x_WB) {
  if (a.kind == ShapeKind::capsule) {
    const CapsuleAt capsule{x_WA, a.radius, a.length};
    if (b.kind == ShapeKind::box) return capsule_on_box(capsule, x_WB, b.edges);
    if (b.kind == ShapeKind::cylinder) return capsule_on_cylinder(capsule, x_WB, b.radius, b.length);
    if (b.kind == ShapeKind::convex_mesh) return capsule_on_mesh(capsule, x_WB, *b.mesh);
    return std::nullopt;
  }
  if (a.kind == ShapeKind::sphere && b.kind == ShapeKind::convex_mesh)
    return capsule_on_mesh({x_WA, a.radius, 0}, x_WB, *b.mesh);
  if (a.kind != ShapeKind::convex_mesh) return std::nullopt;
  if (b.kind == ShapeKind::plane) return mesh_on_plane(*a.mesh, x_WA, x_WB);
  if (b.kind == ShapeKind::convex_mesh) return mesh_on_mesh(*a.mesh, x_WA, *b.mesh, x_WB);
  if (b.kind == ShapeKind::box) return mesh_on_mesh(*a.mesh, x_WA, model::box_polyhedron(b.edges), x_WB);
  return std::nullopt;
}

}  // namespace

std::optional<Manifold> own_manifold(const model::Shape& a, const Pose& x_WA, const model::Shape& b,
                                     const Pose& x_WB) {
  if (auto found = in_order(a, x_WA, b, x_WB)) return found;
  auto found = in_order(b, x_WB, a, x_WA);
  if (found)
    for (ManifoldPoint& point : found->points) point.normal = -point.normal;
  return found;
}

}  // namespace handsim::engine
