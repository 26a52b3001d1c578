// The definition of each shape, and sums over a grid of points: oracles without the formulas of
// handsim/model.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "handsim/model/mass_properties.h"

namespace handsim::model::test {

inline Shape shape_of(ShapeKind kind, const Pose& pose, double radius, double length = 0) {
  Shape out;
  out.kind = kind;
  out.pose = pose;
  out.radius = radius;
  out.length = length;
  return out;
}

inline Shape box_of(const Vec3& edges, const Pose& pose = {}) {
  Shape out;
  out.kind = ShapeKind::box;
  out.edges = edges;
  out.pose = pose;
  return out;
}

/// Whether a point of the shape's own frame is in it. Plain numbers: tests are compiled without optimisation.
inline bool inside(const Shape& shape, const double* p) {
  const double along = std::abs(p[2]), across = std::hypot(p[0], p[1]), half = 0.5 * shape.length;
  switch (shape.kind) {
    case ShapeKind::box:
      return std::abs(p[0]) <= 0.5 * shape.edges.x() && std::abs(p[1]) <= 0.5 * shape.edges.y() &&
             along <= 0.5 * shape.edges.z();
    case ShapeKind::sphere:
      return std::hypot(across, along) <= shape.radius;
    case ShapeKind::cylinder:
      return across <= shape.radius && along <= half;
    case ShapeKind::capsule:
      return std::hypot(across, std::max(0.0, along - half)) <= shape.radius;
    case ShapeKind::convex_mesh:
      for (int face = 0; face < shape.mesh->face_count(); ++face)
        if (shape.mesh->height(face, {p[0], p[1], p[2]}) > 0) return false;
      return true;
    case ShapeKind::plane:
      break;
  }
  return false;
}

/// Mass properties at unit density of the space within some shapes: sums over n^3 cells of a cube of this
/// size about a point, which has them all.
inline MassProperties sampled(const std::vector<Shape>& shapes, const Vec3& middle, double size, int n) {
  const double cell = size / n;
  const auto from_middle = [&](int i) { return cell * (i + 0.5 - 0.5 * n); };
  double count = 0, first[3] = {}, second[3][3] = {};
  std::vector<Mat3> turns;
  std::vector<Vec3> origins;
  for (const Shape& shape : shapes) {
    turns.push_back(shape.pose.q.toRotationMatrix().transpose());
    origins.push_back(turns.back() * (middle - shape.pose.p));
  }
  const auto within = [&](const double* x) {
    for (std::size_t s = 0; s < shapes.size(); ++s) {
      const double *turn = turns[s].data(), *origin = origins[s].data();
      double p[3];
      for (int k = 0; k < 3; ++k) p[k] = origin[k] + turn[k] * x[0] + turn[k + 3] * x[1] + turn[k + 6] * x[2];
      if (inside(shapes[s], p)) return true;
    }
    return false;
  };
  for (int i = 0; i < n * n * n; ++i) {
    const double x[] = {from_middle(i % n), from_middle(i / n % n), from_middle(i / n / n)};
    if (!within(x)) continue;
    count += 1;
    for (int a = 0; a < 3; ++a) {
      first[a] += x[a];
      for (int b = 0; b < 3; ++b) second[a][b] += x[a] * x[b];
    }
  }
  MassProperties out;
  out.mass = count * cell * cell * cell;
  Mat3 spread;
  for (int a = 0; a < 3; ++a) {
    out.centre[a] = middle[a] + first[a] / count;
    for (int b = 0; b < 3; ++b) spread(a, b) = second[a][b] / count - first[a] * first[b] / count / count;
  }
  out.inertia = out.mass * (spread.trace() * Mat3::Identity() - spread);
  return out;
}

}  // namespace handsim::model::test
