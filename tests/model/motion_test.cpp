#include "handsim/model/motion.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace handsim::model {
namespace {

PoseMotion three_keys(Interpolation interpolation) {
  return {{{0.1, {}},
           {0.4, {Vec3(0.2, 0.1, -0.1), rotation_quaternion({1.5, -1, 0.5})}},
           {0.9, {Vec3(-0.1, 0, 0.3), rotation_quaternion({-2, 0.4, 0.1})}}},
          interpolation,
          {}};
}

TEST(PoseMotion, KeyframesAreMetAndMinimumJerkStartsAndEndsAtRest) {
  PoseMotion motion;
  motion.keys = {{1, {{0, 0, 0}, Quat::Identity()}}, {2, {{1, 0, 0}, rotation_quaternion({0, 0, 1})}}};
  EXPECT_EQ(motion.at(0).p.x(), 0);
  EXPECT_EQ(motion.at(9).p.x(), 1);
  EXPECT_NEAR(motion.at(1.5).p.x(), 0.5, 1e-15);
  EXPECT_NEAR(rotation_vector(motion.at(1.5).q).z(), 0.5, 1e-12);
  EXPECT_LT(motion.at(1.001).p.x(), 1.1e-8);  // 10 s^3
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

PoseMotion shaken() {
  PoseMotion motion = three_keys(Interpolation::minimum_jerk);
  motion.shakes.push_back({0.2, 2.5, 2, Vec3(0.04, 0, 0)});
  motion.shakes.push_back({1.1, 5, 3, Vec3(0, -0.01, 0.02)});
  return motion;
}

// Oracle: central differences of the pose.
TEST(PoseMotion, WithShakesHasTheRateOfItsPose) {
  const double h = 1e-5;
  const PoseMotion motion = shaken();
  for (const double time : {0.15, 0.25, 0.6, 0.95, 1.13, 1.4, 1.68, 1.8}) {
    const Vec3 slope = (motion.at(time + h).p - motion.at(time - h).p) / (2 * h);
    EXPECT_LT((motion.rate(time, KeySide::after).v - slope).norm(), 1e-6) << time;
  }
}

// Oracle: definition: rest before and after, and a full swing in between whose acceleration is amplitude
// (2 pi f)^2 at its turning points.
TEST(PoseMotion, ShakesStartAndEndAtRestAndReachTheirAmplitude) {
  const Shake shake{0.3, 4, 3, Vec3(0.01, 0, 0)};
  for (const double time : {0.0, 0.3, shake.end(), 2.0}) {
    EXPECT_EQ(shake.displacement(time), Vec3::Zero());
    EXPECT_LT(shake.velocity(time).norm(), 1e-12);
  }
  EXPECT_NEAR(shake.displacement(0.3 + 1.25 / 4).x(), 0.01, 1e-12);
  const double h = 1e-5, turn = 0.3 + 1.25 / 4;
  const double a = (shake.velocity(turn + h) - shake.velocity(turn - h)).x() / (2 * h);
  EXPECT_NEAR(a, -0.01 * std::pow(2 * M_PI * 4, 2), 1e-4);
}

// Oracle: second differences of the displacement over the whole shake.
TEST(PoseMotion, KnowsTheLargestAccelerationOfAShake) {
  for (const int cycles : {1, 2, 5}) {
    const Shake shake{0, 2, cycles, Vec3(0, 1, 0)};
    double most = 0;
    const double h = 1e-4;
    for (double t = h; t < shake.end(); t += h)
      most = std::max(
          most, (shake.displacement(t + h) - 2 * shake.displacement(t) + shake.displacement(t - h)).norm() /
                    (h * h));
    EXPECT_NEAR(most, 4 * shake_acceleration(cycles), 2e-3 * most) << cycles;
  }
}

// Oracle: central differences of the rate, on lines and curves, with shakes and without, and away from keys:
// there the acceleration of a curve is 0 but has another slope on either side.
TEST(PoseMotion, HasTheAccelerationOfItsRate) {
  const double h = 1e-6;
  double largest = 0;
  for (const PoseMotion& motion :
       {three_keys(Interpolation::linear), three_keys(Interpolation::minimum_jerk), shaken()})
    for (const double time : {0.0, 0.15, 0.25, 0.3, 0.6, 0.77, 0.95, 1.13, 1.4, 1.68, 1.8}) {
      const PoseRate ahead = motion.rate(time + h, KeySide::after),
                     behind = motion.rate(time - h, KeySide::after);
      const PoseRate found = motion.acceleration(time, KeySide::after);
      EXPECT_LT((found.v - (ahead.v - behind.v) / (2 * h)).norm(), 1e-6) << time;
      EXPECT_LT((found.w - (ahead.w - behind.w) / (2 * h)).norm(), 1e-6) << time;
      largest = std::max(largest, std::min(found.v.norm(), found.w.norm()));
    }
  EXPECT_GT(largest, 1);
}

// Oracle: Flash and Hogan: a minimum-jerk curve rests at its ends, is symmetric, and is fastest, 15 / 8 of
// the mean, and unaccelerated in the middle.
TEST(PathFraction, OfMinimumJerkIsThatOfItsSource) {
  constexpr Interpolation kCurve = Interpolation::minimum_jerk;
  for (const double end : {0.0, 1.0}) {
    EXPECT_EQ(path_fraction(kCurve, end), end);
    EXPECT_EQ(path_fraction_rate(kCurve, end), 0);
    EXPECT_EQ(path_fraction_acceleration(kCurve, end), 0);
  }
  for (const double s : {0.1, 0.3, 0.45})
    EXPECT_NEAR(path_fraction(kCurve, s) + path_fraction(kCurve, 1 - s), 1, 1e-15);
  EXPECT_EQ(path_fraction_rate(kCurve, 0.5), 1.875);
  EXPECT_EQ(path_fraction_acceleration(kCurve, 0.5), 0);
}

}  // namespace
}  // namespace handsim::model
