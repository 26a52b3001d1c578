#include "handsim/model/shape_extent.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace handsim::model {

double support(const Shape& shape, const Vec3& n) {
  switch (shape.kind) {
    case ShapeKind::box:
      return 0.5 * shape.edges.dot(n.cwiseAbs());
    case ShapeKind::sphere:
      return shape.radius;
    case ShapeKind::capsule:
      return shape.radius + 0.5 * shape.length * std::abs(n.z());
    case ShapeKind::cylinder:
      return shape.radius * std::hypot(n.x(), n.y()) + 0.5 * shape.length * std::abs(n.z());
    case ShapeKind::convex_mesh:
      return shape.mesh->support(n);
    case ShapeKind::plane:
      break;
  }
  return 0;
}

double reach(const Shape& shape) {
  const Vec3& p = shape.pose.p;
  const Vec3 axis = shape.pose.q * Vec3::UnitZ();
  switch (shape.kind) {
    case ShapeKind::sphere:
      return p.norm() + shape.radius;
    case ShapeKind::capsule:
      return std::max((p + 0.5 * shape.length * axis).norm(), (p - 0.5 * shape.length * axis).norm()) +
             shape.radius;
    case ShapeKind::cylinder: {
      const Vec3 across = p - p.dot(axis) * axis;
      return std::hypot(across.norm() + shape.radius, std::abs(p.dot(axis)) + 0.5 * shape.length);
    }
    case ShapeKind::box: {
      const Vec3 inside = shape.pose.q.conjugate() * p;
      return (inside.cwiseAbs() + 0.5 * shape.edges).norm();
    }
    case ShapeKind::convex_mesh: {
      double most = 0;
      for (const Vec3& vertex : shape.mesh->vertices) most = std::max(most, (shape.pose * vertex).norm());
      return most;
    }
    case ShapeKind::plane:
      return 0;
  }
  return 0;
}

Extent extent(const Shape& shape) {
  const Vec3 half_edges = 0.5 * shape.edges;
  const double half_length = 0.5 * shape.length;
  switch (shape.kind) {
    case ShapeKind::box:
      return {half_edges, 0, 0.5 * shape.edges.norm()};
    case ShapeKind::capsule:
      return {Vec3(0, 0, half_length), shape.radius, half_length};
    case ShapeKind::cylinder:
      return {Vec3(shape.radius, shape.radius, half_length), 0, std::hypot(shape.radius, half_length)};
    case ShapeKind::sphere:
      return {Vec3::Zero(), shape.radius, 0};
    case ShapeKind::convex_mesh:
      return {Vec3::Zero(), shape.mesh->reach, 0};
    case ShapeKind::plane:
      break;
  }
  return {};
}

double inner_radius(const Shape& shape) {
  switch (shape.kind) {
    case ShapeKind::box:
      return 0.5 * shape.edges.minCoeff();
    case ShapeKind::capsule:
    case ShapeKind::sphere:
      return shape.radius;
    case ShapeKind::cylinder:
      return std::min(shape.radius, 0.5 * shape.length);
    case ShapeKind::convex_mesh:
      return shape.mesh->inner;
    case ShapeKind::plane:
      break;
  }
  return std::numeric_limits<double>::infinity();
}

Vec3 box_edges(const std::vector<Shape>& shapes) {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const Shape& shape : shapes)
    for (int i = 0; i < 3; ++i) {
      const Vec3 n = shape.pose.q.conjugate() * Vec3::Unit(i);
      low[i] = std::min(low[i], shape.pose.p[i] - support(shape, -n));
      high[i] = std::max(high[i], shape.pose.p[i] + support(shape, n));
    }
  return high - low;
}

}  // namespace handsim::model
