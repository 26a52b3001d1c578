#include "handsim/output/render/solid.h"

#include <algorithm>
#include <limits>

namespace handsim::output {

double Solid::thickness() const {
  // A core that is flat in some direction is a line or a point: only its radius counts.
  return round + half.minCoeff();
}

Solid solid(const DrawShape& shape) {
  switch (shape.kind) {
    case model::ShapeKind::box:
      return {Core::box, shape.edges / 2, 0, shape.pose};
    case model::ShapeKind::capsule:
      return {Core::box, {0, 0, shape.length / 2}, shape.radius, shape.pose};
    case model::ShapeKind::cylinder:
      return {Core::cylinder, {shape.radius, shape.radius, shape.length / 2}, 0, shape.pose};
    case model::ShapeKind::convex_mesh: {
      Vec3 half = Vec3::Zero();
      for (const Vec3& vertex : shape.mesh->vertices) half = half.cwiseMax(vertex.cwiseAbs());
      return {Core::hull, half, 0, shape.pose, shape.mesh};
    }
    case model::ShapeKind::sphere:
    case model::ShapeKind::plane:
      break;
  }
  return {Core::box, Vec3::Zero(), shape.radius, shape.pose};
}

Solid bevelled(const Solid& exact) {
  if (exact.core == Core::hull) return exact;
  const double bevel = 0.12 * exact.half.minCoeff();
  return {exact.core, exact.half - Vec3::Constant(bevel), exact.round + bevel, exact.pose, {}};
}

bool is_capsule(const Solid& solid) { return solid.half.x() <= 0 && solid.half.y() <= 0; }

double support(const Solid& solid, const Vec3& n) {
  const Vec3 m = solid.pose.q.conjugate() * n;
  if (solid.core == Core::hull) return n.dot(solid.pose.p) + solid.mesh->support(m);
  const double core = solid.core == Core::box
                          ? solid.half.dot(m.cwiseAbs())
                          : solid.half.x() * m.head<2>().norm() + solid.half.z() * std::abs(m.z());
  return n.dot(solid.pose.p) + core + solid.round * n.norm();
}

double support(const DrawList& list, const Vec3& n) {
  double most = -std::numeric_limits<double>::infinity();
  for (const DrawShape& shape : list.shapes) most = std::max(most, support(solid(shape), n));
  for (const DrawArrow& arrow : list.arrows)
    most =
        std::max(most, std::max(n.dot(arrow.from), n.dot(arrow.to)) + kHeadWidth * arrow.radius * n.norm());
  for (const DrawPoint& point : list.points)
    most = std::max(most, n.dot(point.position) + point.radius * n.norm());
  return most;
}

}  // namespace handsim::output
