#include "handsim/model/shape_extent.h"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "engine/models.h"
#include "model/shape_samples.h"

namespace handsim::model {
namespace {

/// Points all over a sphere, no direction further than kNear from one: a spiral.
constexpr int kSpiral = 4000;
constexpr double kNear = 0.06;
std::vector<Vec3> spiral(double radius, const Vec3& centre = Vec3::Zero()) {
  std::vector<Vec3> out;
  for (int i = 0; i < kSpiral; ++i) {
    const double z = 1 - (2 * i + 1.0) / kSpiral, across = std::sqrt(1 - z * z),
                 angle = 2.399963229728653 * i;
    out.push_back(centre + radius * Vec3(across * std::cos(angle), across * std::sin(angle), z));
  }
  return out;
}

/// Points of a shape's surface in its own frame; its hull is smaller by kNear^2 / 2 of a radius at most.
std::vector<Vec3> surface(const Shape& shape) {
  const double half = 0.5 * shape.length;
  std::vector<Vec3> out;
  switch (shape.kind) {
    case ShapeKind::box:
      return box_polyhedron(shape.edges).vertices;
    case ShapeKind::convex_mesh:
      return shape.mesh->vertices;
    case ShapeKind::sphere:
      return spiral(shape.radius);
    case ShapeKind::capsule:
      out = spiral(shape.radius, {0, 0, half});
      for (const Vec3& point : spiral(shape.radius, {0, 0, -half})) out.push_back(point);
      return out;
    case ShapeKind::cylinder:
      for (int i = 0; i < kSpiral; ++i)
        for (const double z : {-half, half}) {
          const double angle = 2 * M_PI * i / kSpiral;
          out.emplace_back(shape.radius * std::cos(angle), shape.radius * std::sin(angle), z);
        }
      return out;
    case ShapeKind::plane:
      break;
  }
  return out;
}

std::vector<Shape> bounded(std::mt19937& random) {
  std::vector<Shape> out = {test::box_of({0.06, 0.02, 0.04}),
                            test::shape_of(ShapeKind::sphere, {}, 0.03),
                            test::shape_of(ShapeKind::cylinder, {}, 0.02, 0.07),
                            test::shape_of(ShapeKind::cylinder, {}, 0.03, 0.02),
                            test::shape_of(ShapeKind::capsule, {}, 0.01, 0.05),
                            test::shape_of(ShapeKind::convex_mesh, {}, 0)};
  Vec3 centroid;
  out.back().mesh = std::make_shared<const ConvexMesh>(
      make_convex_mesh({{0, 0, 0}, {0.06, 0, 0}, {0.01, 0.05, 0}, {0, 0.02, 0.04}},
                       {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}, centroid));
  for (Shape& shape : out) shape.pose = engine::test::random_pose(random, 0.1);
  return out;
}

/// The gap between the hull of surface() and the shape [m], and rounding.
double missing(const Shape& shape) { return 0.5 * kNear * kNear * shape.radius + 1e-15; }

// Oracle: points of the surface, the farthest of which gives each figure but for what is between points.
TEST(ShapeExtent, IsThatOfTheFarthestPointOfTheSurface) {
  std::mt19937 random(3);
  for (const Shape& shape : bounded(random)) {
    SCOPED_TRACE(static_cast<int>(shape.kind));
    const std::vector<Vec3> points = surface(shape);
    const auto farthest = [&](auto of) {
      double most = -1;
      for (const Vec3& point : points) most = std::max(most, of(point));
      return most;
    };
    const auto expect_most = [&](double found, double sampled) {
      EXPECT_GE(found, sampled - 1e-15);
      EXPECT_LE(found, sampled + missing(shape));
    };
    for (int trial = 0; trial < 10; ++trial) {
      const Vec3 n = engine::test::random_vector(random).normalized();
      expect_most(support(shape, n), farthest([&](const Vec3& p) { return n.dot(p); }));
    }
    expect_most(reach(shape), farthest([&](const Vec3& p) { return (shape.pose * p).norm(); }));
    const Extent bounds = extent(shape);
    expect_most(bounds.farthest + bounds.round, farthest([&](const Vec3& p) { return p.norm(); }));
    if (shape.kind == ShapeKind::convex_mesh) continue;  // has a sphere instead
    for (int k = 0; k < 3; ++k)
      expect_most(bounds.half[k] + bounds.round, farthest([&](const Vec3& p) { return std::abs(p[k]); }));
  }
}

// Oracle: the largest ball about the centre of a convex shape has its smallest support as radius: at the
// normal of a face, or anywhere on a round side.
TEST(ShapeExtent, InnerRadiusIsTheLeastSupport) {
  std::mt19937 random(5);
  for (const Shape& shape : bounded(random)) {
    SCOPED_TRACE(static_cast<int>(shape.kind));
    std::vector<Vec3> normals = spiral(1);
    for (int k = 0; k < 3; ++k) normals.emplace_back(Vec3::Unit(k));
    if (shape.mesh)
      for (int face = 0; face < shape.mesh->face_count(); ++face) normals.push_back(shape.mesh->normal(face));
    double least = 1;
    for (const Vec3& n : normals) least = std::min(least, support(shape, n));
    EXPECT_NEAR(inner_radius(shape), least, 1e-15);
  }
  EXPECT_EQ(inner_radius(test::shape_of(ShapeKind::plane, {}, 0)), std::numeric_limits<double>::infinity());
}

// Oracle: bounds of points of all surfaces in their common frame.
TEST(ShapeExtent, BoxEdgesAreThoseOfTheBoundsOfAllPoints) {
  std::mt19937 random(7);
  const std::vector<Shape> shapes = bounded(random);
  Vec3 low = Vec3::Constant(1), high = -low;
  for (const Shape& shape : shapes)
    for (const Vec3& point : surface(shape)) {
      low = low.cwiseMin(shape.pose * point);
      high = high.cwiseMax(shape.pose * point);
    }
  const Vec3 more = box_edges(shapes) - (high - low);
  EXPECT_GE(more.minCoeff(), -1e-15);
  EXPECT_LE(more.maxCoeff(), kNear * kNear * 0.03);
}

}  // namespace
}  // namespace handsim::model
