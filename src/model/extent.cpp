#include "handsim/model/extent.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace handsim::model {

double reach(const Shape& shape, const Vec3& n) {
  const double across = std::hypot(n.x(), n.y());
  switch (shape.kind) {
    case ShapeKind::box:
      return 0.5 * shape.edges.dot(n.cwiseAbs());
    case ShapeKind::sphere:
      return shape.radius;
    case ShapeKind::capsule:
      return shape.radius + 0.5 * shape.length * std::abs(n.z());
    case ShapeKind::cylinder:
      return shape.radius * across + 0.5 * shape.length * std::abs(n.z());
    case ShapeKind::convex_mesh:
      return shape.mesh->support(n);
    case ShapeKind::plane:
      return 0;
  }
  return 0;
}

Vec3 extent(const std::vector<Shape>& shapes) {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const Shape& shape : shapes)
    for (int i = 0; i < 3; ++i) {
      const Vec3 n = shape.pose.q.conjugate() * Vec3::Unit(i);
      low[i] = std::min(low[i], shape.pose.p[i] - reach(shape, -n));
      high[i] = std::max(high[i], shape.pose.p[i] + reach(shape, n));
    }
  return high - low;
}

}  // namespace handsim::model
