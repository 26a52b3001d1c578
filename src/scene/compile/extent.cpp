#include "handsim/scene/compile/extent.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace handsim::scene {

double reach(const model::Shape& shape, const Vec3& n) {
  const double across = std::hypot(n.x(), n.y());
  double most = 0;
  switch (shape.kind) {
    case model::ShapeKind::box:
      return 0.5 * shape.edges.dot(n.cwiseAbs());
    case model::ShapeKind::sphere:
      return shape.radius;
    case model::ShapeKind::capsule:
      return shape.radius + 0.5 * shape.length * std::abs(n.z());
    case model::ShapeKind::cylinder:
      return shape.radius * across + 0.5 * shape.length * std::abs(n.z());
    case model::ShapeKind::convex_mesh:
      for (const Vec3& vertex : shape.mesh->vertices) most = std::max(most, vertex.dot(n));
      return most;
    case model::ShapeKind::plane:
      return 0;
  }
  return 0;
}

Vec3 extent(const std::vector<model::Shape>& shapes) {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const model::Shape& shape : shapes)
    for (int i = 0; i < 3; ++i) {
      const Vec3 n = shape.pose.q.conjugate() * Vec3::Unit(i);
      low[i] = std::min(low[i], shape.pose.p[i] - reach(shape, -n));
      high[i] = std::max(high[i], shape.pose.p[i] + reach(shape, n));
    }
  return high - low;
}

}  // namespace handsim::scene
