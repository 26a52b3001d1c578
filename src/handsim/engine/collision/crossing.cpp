#include "handsim/engine/collision/crossing.h"

#include <algorithm>
#include <cmath>

namespace handsim::engine {

namespace {

using model::Shape;
using model::ShapeKind;

/// The part of a line that lies within a convex solid, as shares of its length; empty where low >= high.
struct Part {
  double low = 0, high = 1;

  /// Keeps what lies below a height of a plane: start + rise t <= top.
  void below(double start, double rise, double top) {
    if (rise > 0)
      high = std::min(high, (top - start) / rise);
    else if (rise < 0)
      low = std::max(low, (top - start) / rise);
    else if (start > top)
      high = -1;
  }
  /// Keeps the part of the line where a t^2 + 2 b t + c, squared distance less squared radius, is below 0.
  void within(double a, double b, double c) {
    const double root2 = b * b - a * c;
    if (!(a > 0)) {
      if (c > 0) high = -1;
      return;
    }
    if (!(root2 > 0)) {
      high = -1;
      return;
    }
    low = std::max(low, (-b - std::sqrt(root2)) / a);
    high = std::min(high, (-b + std::sqrt(root2)) / a);
  }
  bool empty() const { return !(low < high); }
};

Part in_ball(const Vec3& from, const Vec3& along, double radius) {
  Part part;
  part.within(along.squaredNorm(), from.dot(along), from.squaredNorm() - radius * radius);
  return part;
}

Part in_cylinder(const Vec3& from, const Vec3& along, double radius, double length) {
  Part part;
  part.below(from.z(), along.z(), 0.5 * length);
  part.below(-from.z(), -along.z(), 0.5 * length);
  const auto a = along.head<2>(), f = from.head<2>();
  part.within(a.squaredNorm(), f.dot(a), f.squaredNorm() - radius * radius);
  return part;
}

Part in_box(const Vec3& from, const Vec3& along, const Vec3& edges) {
  Part part;
  for (int i = 0; i < 3; ++i) {
    part.below(from[i], along[i], 0.5 * edges[i]);
    part.below(-from[i], -along[i], 0.5 * edges[i]);
  }
  return part;
}

Part in_mesh(const Vec3& from, const Vec3& along, const model::ConvexMesh& mesh) {
  Part part;
  for (int f = 0; f < mesh.face_count(); ++f) part.below(mesh.height(f, from), mesh.normal(f).dot(along), 0);
  return part;
}

bool passes(const Part& part) { return !part.empty() && part.low > 0 && part.high < 1; }

/// A cylinder with a ball at each end: the line leaves none of them within another.
bool crosses_capsule(const Shape& shape, const Vec3& from, const Vec3& along) {
  const Vec3 end(0, 0, 0.5 * shape.length);
  bool any = false;
  for (const Part& part :
       {in_cylinder(from, along, shape.radius, shape.length), in_ball(from - end, along, shape.radius),
        in_ball(from + end, along, shape.radius)}) {
    if (part.empty()) continue;
    if (!passes(part)) return false;
    any = true;
  }
  return any;
}

}  // namespace

bool crosses(const Shape& shape, const Vec3& from, const Vec3& to) {
  const Vec3 along = to - from;
  switch (shape.kind) {
    case ShapeKind::box:
      return passes(in_box(from, along, shape.edges));
    case ShapeKind::capsule:
      return crosses_capsule(shape, from, along);
    case ShapeKind::cylinder:
      return passes(in_cylinder(from, along, shape.radius, shape.length));
    case ShapeKind::sphere:
      return passes(in_ball(from, along, shape.radius));
    case ShapeKind::convex_mesh:
      return passes(in_mesh(from, along, *shape.mesh));
    case ShapeKind::plane:
      break;
  }
  return false;
}

}  // namespace handsim::engine
