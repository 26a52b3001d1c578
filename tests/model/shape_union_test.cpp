#include "handsim/model/shape_union.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "handsim/core/error.h"
#include "model/shape_samples.h"

namespace handsim::model {
namespace {

Shape capsule(const Vec3& from, const Vec3& to, double radius) {
  Shape out;
  out.kind = ShapeKind::capsule;
  out.radius = radius;
  out.length = (to - from).norm();
  out.pose = {0.5 * (from + to), Quat::FromTwoVectors(Vec3::UnitZ(), to - from)};
  return out;
}

// Oracle: the lens of two spheres, pi (4 r + d) (2 r - d)^2 / 12, and their symmetry.
TEST(ShapeUnion, OfTwoSpheresLeavesTheLensOut) {
  Shape a, b;
  a.kind = b.kind = ShapeKind::sphere;
  a.radius = b.radius = 0.01;
  a.pose.p = {0, 0.003, 0.02};
  b.pose.p = a.pose.p + 0.012 * Vec3(2, 3, 6) / 7;
  const double lens = M_PI * (0.04 + 0.012) * 0.008 * 0.008 / 12;
  const double volume = 2 * 4.0 / 3 * M_PI * 1e-6 - lens;
  const MassProperties whole = union_properties({a, b});
  EXPECT_NEAR(whole.mass, volume, 2e-3 * volume);
  EXPECT_LT((whole.centre - 0.5 * (a.pose.p + b.pose.p)).norm(), 2e-5);
}

// Oracle: a solid twice is that solid, in closed form; solids apart are joined rigidly.
TEST(ShapeUnion, AgreesWithClosedForms) {
  const Shape one = capsule({0.01, 0, 0.004}, {0.02, 0.05, -0.01}, 0.012);
  const Shape two = capsule({0.06, 0.01, 0}, {0.06, 0.05, 0.03}, 0.009);
  Shape box;
  box.kind = ShapeKind::box;
  box.edges = {0.03, 0.02, 0.05};
  box.pose = {{-0.05, 0.02, 0.01}, Quat(Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()))};
  const auto near = [](const MassProperties& got, const MassProperties& want) {
    EXPECT_NEAR(got.mass, want.mass, 1e-3 * want.mass);
    EXPECT_LT((got.centre - want.centre).norm(), 2e-5);
    EXPECT_LT((got.inertia - want.inertia).norm(), 2e-3 * want.inertia.norm());
  };
  const auto solid = [](const Shape& shape) { return solid_properties(shape, volume(shape)); };
  near(union_properties({one, one}), solid(one));
  near(union_properties({one, two, box}), joined({solid(one), solid(two), solid(box)}));
}

// Oracle: closed forms of a box and of half a ball, whose centre is 3/8 r from its flat side.
TEST(ShapeUnion, OfABoxAndABallInItsFaceHasHalfABallMore) {
  const Pose pose{{0.02, -0.01, 0.03}, Quat(Eigen::AngleAxisd(1.1, Vec3(1, -2, 2).normalized()))};
  const double r = 0.01, half = 2.0 / 3 * M_PI * r * r * r;
  const Shape box = test::box_of({0.04, 0.05, 0.03}, pose);
  const Shape ball = test::shape_of(ShapeKind::sphere, {pose * Vec3(0.002, -0.004, 0.015), pose.q}, r);
  const Mat3 turn = pose.q.toRotationMatrix();
  const Vec3 moments = half * r * r * Vec3(83.0 / 320, 83.0 / 320, 0.4);
  const MassProperties want =
      joined({solid_properties(box, volume(box)),
              {half, ball.pose.p + 0.375 * r * turn.col(2), turn * moments.asDiagonal() * turn.transpose()}});
  const MassProperties found = union_properties({box, ball});
  EXPECT_NEAR(found.mass, want.mass, 1e-3 * half);
  EXPECT_LT((found.centre - want.centre).norm(), 1e-5);
  EXPECT_LT((found.inertia - want.inertia).norm(), 1e-4 * want.inertia.norm());
}

// Oracle: sums over a grid, of which 0.5 % may be off, for boxes, capsules and balls through each other. What
// two of them share, and three, counts once: with it twice the volume would be a fifth more.
TEST(ShapeUnion, OfManyIsThatOfAGridOfPoints) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector = [&](double size) {
    const double x = uniform(random), y = uniform(random), z = uniform(random);
    return Vec3(size * Vec3(x, y, z));
  };
  const auto pose = [&] { return Pose{vector(0.008), rotation_quaternion(vector(2))}; };
  for (int trial = 0; trial < 4; ++trial) {
    const std::vector<Shape> shapes = {test::shape_of(ShapeKind::capsule, pose(), 0.01, 0.03),
                                       test::box_of({0.03, 0.015, 0.02}, pose()),
                                       test::shape_of(ShapeKind::sphere, pose(), 0.012),
                                       test::shape_of(ShapeKind::capsule, pose(), 0.007, 0.02)};
    const MassProperties found = union_properties(shapes);
    const MassProperties want = test::sampled(shapes, Vec3::Zero(), 0.09, 60);
    double sum = 0;
    for (const Shape& shape : shapes) sum += volume(shape);
    EXPECT_GT(sum, 1.2 * found.mass);
    EXPECT_NEAR(found.mass, want.mass, 5e-3 * want.mass) << trial;
    EXPECT_LT((found.centre - want.centre).norm(), 1e-4) << trial;
    EXPECT_LT((found.inertia - want.inertia).norm(), 1e-2 * want.inertia.norm()) << trial;
  }
}

TEST(ShapeUnion, RefusesAKindThatItCannotCut) {
  const Shape ball = test::shape_of(ShapeKind::sphere, {}, 0.01);
  EXPECT_THROW(union_properties({ball, test::shape_of(ShapeKind::cylinder, {}, 0.01, 0.02)}), Error);
}

}  // namespace
}  // namespace handsim::model
