#include "handsim/model/motion.h"

#include <gtest/gtest.h>

namespace handsim::model {
namespace {

PoseMotion three_keys(Interpolation interpolation) {
  return {{{0.1, {}},
           {0.4, {Vec3(0.2, 0.1, -0.1), rotation_quaternion({1.5, -1, 0.5})}},
           {0.9, {Vec3(-0.1, 0, 0.3), rotation_quaternion({-2, 0.4, 0.1})}}},
          interpolation};
}

// Oracle: central differences of the pose.
TEST(PoseMotion, HasTheRateOfItsPose) {
  const double h = 1e-5;
  for (const Interpolation interpolation : {Interpolation::linear, Interpolation::minimum_jerk}) {
    const PoseMotion motion = three_keys(interpolation);
    for (const double time : {0.0, 0.15, 0.3, 0.5, 0.77, 1.0}) {
      const Pose ahead = motion.at(time + h), behind = motion.at(time - h);
      const PoseRate rate = motion.rate(time, KeySide::after);
      EXPECT_LT((rate.v - (ahead.p - behind.p) / (2 * h)).norm(), 1e-6);
      EXPECT_LT((rate.w - rotation_vector(ahead.q * behind.q.conjugate()) / (2 * h)).norm(), 1e-6);
    }
  }
}

// Oracle: definition; a linear motion has two rates at a key, one of them zero at either end.
TEST(PoseMotion, HasARateOnEitherSideOfAKey) {
  const PoseMotion motion = three_keys(Interpolation::linear);
  EXPECT_EQ(motion.rate(0.1, KeySide::before).v, Vec3::Zero());
  EXPECT_EQ(motion.rate(0.9, KeySide::after).w, Vec3::Zero());
  EXPECT_LT((motion.rate(0.4, KeySide::before).v - motion.rate(0.2, KeySide::after).v).norm(), 1e-12);
  EXPECT_LT((motion.rate(0.4, KeySide::after).v - motion.rate(0.6, KeySide::after).v).norm(), 1e-12);
}

}  // namespace
}  // namespace handsim::model
