#include "handsim/model/mass_properties.h"

#include <cmath>

#include <gtest/gtest.h>

#include "model/shape_samples.h"

namespace handsim::model {
namespace {

// Oracle: a capsule of no length is a sphere, a thin long one is a rod.
TEST(CapsuleInertia, HasTheLimitsOfSphereAndRod) {
  const CapsuleInertia ball = capsule_inertia(0.5, 1e-12);
  EXPECT_NEAR(ball.axial, 0.4 * 0.25, 1e-12);
  EXPECT_NEAR(ball.transverse, 0.4 * 0.25, 1e-12);
  const CapsuleInertia rod = capsule_inertia(1e-6, 2);
  EXPECT_NEAR(rod.transverse, 4.0 / 12, 1e-5);
}

// Oracle: the same moments by summing small discs along the axis.
TEST(CapsuleInertia, EqualsTheSumOfDiscs) {
  const double r = 0.009, l = 0.03;
  const int n = 200'000;
  double volume = 0, axial = 0, transverse = 0;
  for (int i = 0; i < n; ++i) {
    const double dz = (l + 2 * r) / n;
    const double z = -l / 2 - r + (i + 0.5) * dz;
    const double beyond = std::max(0.0, std::abs(z) - l / 2);
    const double r2 = r * r - beyond * beyond;
    const double v = M_PI * r2 * dz;
    volume += v;
    axial += v * r2 / 2;
    transverse += v * (r2 / 4 + z * z);
  }
  const CapsuleInertia solid = capsule_inertia(r, l);
  EXPECT_NEAR(solid.volume, volume, 1e-6 * volume);
  EXPECT_NEAR(solid.axial, axial / volume, 1e-6 * solid.axial);
  EXPECT_NEAR(solid.transverse, transverse / volume, 1e-6 * solid.transverse);
}

/// One of each solid, small enough for a cube of 0.1 m about its centre.
std::vector<Shape> solids(const Pose& pose) {
  Shape mesh = test::shape_of(ShapeKind::convex_mesh, pose, 0);
  Vec3 centroid;
  mesh.mesh = std::make_shared<const ConvexMesh>(
      make_convex_mesh({{0, 0, 0}, {0.06, 0, 0}, {0.01, 0.05, 0}, {0, 0.02, 0.04}},
                       {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}, centroid));
  return {test::box_of({0.06, 0.02, 0.04}, pose), test::shape_of(ShapeKind::sphere, pose, 0.03),
          test::shape_of(ShapeKind::cylinder, pose, 0.02, 0.07),
          test::shape_of(ShapeKind::capsule, pose, 0.02, 0.03), mesh};
}

// Oracle: sums over a grid in the outer frame. Tolerance: the solids' surfaces cut its cells of 1/60 of the
// cube at random, which leaves 0.4 % at most; a wrong factor, or a turn the wrong way, is several times that.
TEST(SolidProperties, AreThoseOfAGridOfPoints) {
  const Pose pose{{0.3, -0.1, 0.2}, Quat(Eigen::AngleAxisd(0.9, Vec3(1, 2, -3).normalized()))};
  for (const Shape& solid : solids(pose)) {
    SCOPED_TRACE(static_cast<int>(solid.kind));
    const MassProperties want = test::sampled({solid}, pose.p, 0.1, 60);
    EXPECT_NEAR(volume(solid), want.mass, 4e-3 * want.mass);
    const MassProperties found = solid_properties(solid, want.mass);
    EXPECT_EQ(found.mass, want.mass);
    EXPECT_LT((found.centre - want.centre).norm(), 2e-4);
    EXPECT_LT((found.inertia - want.inertia).norm(), 4e-3 * want.inertia.norm());
  }
  EXPECT_EQ(volume(test::shape_of(ShapeKind::plane, pose, 0)), 0);
}

// Oracle: closed forms: principal moments of textbooks, and of two balls the reduced mass times d^2.
TEST(SolidProperties, AreThoseOfTextbooks) {
  const auto moments = [](const Shape& shape) { return Vec3(solid_properties(shape, 6).inertia.diagonal()); };
  EXPECT_LT((moments(test::box_of({1, 2, 4})) - Vec3(10, 8.5, 2.5)).norm(), 1e-14);
  EXPECT_LT((moments(test::shape_of(ShapeKind::sphere, {}, 0.5)) - Vec3::Constant(0.6)).norm(), 1e-15);
  EXPECT_LT((moments(test::shape_of(ShapeKind::cylinder, {}, 2, 4)) - Vec3(14, 14, 12)).norm(), 1e-14);
  const Pose left{{0.1, 0.2, 0.3}, Quat::Identity()}, right{{0.5, 0.2, 0.3}, Quat::Identity()};
  const MassProperties pair = joined({solid_properties(test::shape_of(ShapeKind::sphere, left, 0.1), 1),
                                      solid_properties(test::shape_of(ShapeKind::sphere, right, 0.2), 3)});
  EXPECT_EQ(pair.mass, 4);
  EXPECT_LT((pair.centre - Vec3(0.4, 0.2, 0.3)).norm(), 1e-15);
  const double own = 0.4 * (0.01 + 3 * 0.04), apart = 0.75 * 0.16;
  EXPECT_LT((pair.inertia - Mat3(Vec3(own, own + apart, own + apart).asDiagonal())).norm(), 1e-15);
}

// Oracle: a box sawn into eight unequal parts and joined again. Tolerance: rounding.
TEST(Joined, PartsOfABoxAreTheBox) {
  const Vec3 edges(0.3, 0.1, 0.2), cut(0.07, 0.02, 0.11);
  const Pose pose{{0.5, -2, 1}, Quat(Eigen::AngleAxisd(-0.6, Vec3(2, 1, 1).normalized()))};
  std::vector<MassProperties> parts;
  for (int i = 0; i < 8; ++i) {
    Vec3 part, middle;
    for (int k = 0; k < 3; ++k) {
      const bool upper = (i >> k & 1) != 0;
      part[k] = upper ? edges[k] - cut[k] : cut[k];
      middle[k] = upper ? 0.5 * cut[k] : 0.5 * (cut[k] - edges[k]);
    }
    const Shape piece = test::box_of(part, pose * Pose{middle, Quat::Identity()});
    parts.push_back(solid_properties(piece, 700 * volume(piece)));
  }
  const Shape box = test::box_of(edges, pose);
  const MassProperties found = joined(parts), want = solid_properties(box, 700 * volume(box));
  EXPECT_NEAR(found.mass, want.mass, 1e-14);
  EXPECT_LT((found.centre - want.centre).norm(), 1e-14);
  EXPECT_LT((found.inertia - want.inertia).norm(), 1e-14 * found.mass);
  EXPECT_EQ(found.inertia, found.inertia.transpose().eval());
}

}  // namespace
}  // namespace handsim::model
