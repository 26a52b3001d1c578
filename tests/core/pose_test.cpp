#include "handsim/core/pose.h"
#include "handsim/core/triple.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

namespace handsim {
namespace {

TEST(Pose, InverseUndoes) {
  const Pose x{{1, -2, 3}, Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, -1).normalized()))};
  const Vec3 p(0.3, 0.1, -5);
  EXPECT_LT(((x.inverse() * (x * p)) - p).norm(), 1e-14);
  EXPECT_LT((((x * x.inverse()) * p) - p).norm(), 1e-14);
}

// Oracle: the mirror matrix M = diag(-1, 1, 1) itself: M R M must be the mirrored rotation, and the rotation
// by the same angle about the mirrored axis.
TEST(Pose, MirrorOfARotationIsTheRotationAboutTheMirroredAxis) {
  const Mat3 m = Vec3(-1, 1, 1).asDiagonal();
  const Vec3 axis = Vec3(0.2, -0.7, 0.4).normalized();
  const Quat q(Eigen::AngleAxisd(1.1, axis));
  const Mat3 expected = m * q.toRotationMatrix() * m;
  EXPECT_LT((mirrored(q).toRotationMatrix() - expected).norm(), 1e-15);
  EXPECT_LT((Eigen::AngleAxisd(1.1, mirrored_axis(axis)).toRotationMatrix() - expected).norm(), 1e-15);
}

// Oracle: where it turns the first direction, and the angle between them.
TEST(Pose, RotationBetweenIsTheShortestAlsoForOppositeDirections) {
  const Vec3 from(0.3, -1.2, 0.4), side = from.unitOrthogonal();
  for (const double angle : {0.0, 1e-9, 1e-3, 1.0, 3.0, M_PI - 1e-5, M_PI - 1e-7, M_PI}) {
    const Vec3 to = 2.5 * (std::cos(angle) * from.normalized() + std::sin(angle) * side);
    const Quat turn = rotation_between(from, to);
    EXPECT_NEAR(turn.norm(), 1, 1e-12) << angle;
    EXPECT_LT((turn * from.normalized() - to.normalized()).norm(), 1e-10) << angle;
    EXPECT_NEAR(rotation_vector(turn).norm(), angle, 1e-9) << angle;
  }
}

TEST(Pose, RotationVectorsGoThereAndBack) {
  for (const double angle : {0.0, 1e-14, 1e-9, 1e-3, 1.0, 3.0, 3.14159}) {
    const Vec3 r = angle * Vec3(0.6, -0.8, 0).normalized();
    EXPECT_LT((rotation_vector(rotation_quaternion(r)) - r).norm(), 1e-12) << angle;
  }
}

/// Rotations of inner loops give the bits of Eigen's, which results were recorded with.
TEST(Triple, RotatesAsEigenDoes) {
  std::srand(1);
  for (int i = 0; i < 1000; ++i) {
    const Quat q = Quat::UnitRandom();
    const Vec3 v = Vec3::Random();
    EXPECT_EQ(Vec3(rotate(q, v)), q * v);
    EXPECT_EQ(Vec3(rotate_back(q, v)), q.conjugate() * v);
  }
}

}  // namespace
}  // namespace handsim
