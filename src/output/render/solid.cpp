#include "handsim/output/render/solid.h"

namespace handsim::output {

Solid solid(const model::Shape& shape, const Pose& x_WS) {
  switch (shape.kind) {
    case model::ShapeKind::box:
      return {Core::box, shape.edges / 2, 0, x_WS};
    case model::ShapeKind::capsule:
      return {Core::box, {0, 0, shape.length / 2}, shape.radius, x_WS};
    case model::ShapeKind::cylinder:
      return {Core::cylinder, {shape.radius, shape.radius, shape.length / 2}, 0, x_WS};
    case model::ShapeKind::convex_mesh: {
      Vec3 half = Vec3::Zero();
      for (const Vec3& vertex : shape.mesh->vertices) half = half.cwiseMax(vertex.cwiseAbs());
      return {Core::hull, half, 0, x_WS, shape.mesh};
    }
    case model::ShapeKind::sphere:
    case model::ShapeKind::plane:
      break;
  }
  return {Core::box, Vec3::Zero(), shape.radius, x_WS};
}

Solid bevelled(Solid exact) {
  if (exact.core == Core::hull) return exact;
  const double bevel = 0.12 * exact.half.minCoeff();
  exact.half -= Vec3::Constant(bevel);
  exact.round += bevel;
  return exact;
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

}  // namespace handsim::output
