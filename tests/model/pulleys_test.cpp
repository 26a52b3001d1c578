#include "handsim/model/pulleys.h"

#include <gtest/gtest.h>

namespace handsim::model {
namespace {

constexpr double kDegree = M_PI / 180;

// Oracle: cadaver fingers at failure (Schoeffl 2009): a deep tendon of 348 N had 287 and 226 N on A2 and A4
// in a crimp, one of 371 N 121 and 103 N in a slope grip; at PIP angles of 87 and 39 deg (Fischer 2024). The
// law is within 15 % of them.
TEST(Pulleys, HaveThePublishedForcesAtFailure) {
  const PulleyForces crimp = pulley_forces({348, 0}, 87 * kDegree),
                     slope = pulley_forces({371, 0}, 39 * kDegree);
  EXPECT_NEAR(crimp.a2, kA2Strength, 0.05 * kA2Strength);
  EXPECT_NEAR(crimp.a4, kA4Strength, 0.05 * kA4Strength);
  EXPECT_NEAR(slope.a2, 121, 0.15 * 121);
  EXPECT_NEAR(slope.a4, 103, 0.15 * 103);
}

// Oracle: the polygon of forces: a belt that turns by t presses with the sum of its two pulls. The
// superficial flexor loads A2 alone; a PIP that is bent backwards loads none.
TEST(Pulleys, CarryTheSumOfTheTendonsPulls) {
  const FlexorTensions tensions{50, 30};
  const double pip = 1.3, at_a2 = 0.55 * pip, at_a4 = 0.45 * pip;
  const auto pressed = [](double tension, double turn) {
    return tension * std::hypot(1 - std::cos(turn), std::sin(turn));
  };
  EXPECT_NEAR(pulley_forces(tensions, pip).a2, pressed(80, at_a2), 1e-13);
  EXPECT_NEAR(pulley_forces(tensions, pip).a4, pressed(50, at_a4), 1e-13);
  EXPECT_EQ(pulley_forces(tensions, -0.2).a2, 0);
  EXPECT_EQ(pulley_forces(tensions, -0.2).a4, 0);
}

// Oracle: equilibrium: tensions times arms are the moments of both joints, and no tendon pushes.
TEST(Pulleys, TensionsBalanceBothJoints) {
  const FlexorTensions both = flexor_tensions(0.2, 0.9, 0.006, 0.01, 0.008);
  EXPECT_NEAR(both.deep * 0.006, 0.2, 1e-16);
  EXPECT_NEAR(both.deep * 0.01 + both.superficial * 0.008, 0.9, 1e-15);
  // The deep flexor has more moment at the PIP than it needs.
  EXPECT_EQ(flexor_tensions(0.2, 0.3, 0.006, 0.01, 0.008).superficial, 0);
  EXPECT_EQ(flexor_tensions(-0.2, 0.4, 0.006, 0.01, 0.008).deep, 0);
  EXPECT_NEAR(flexor_tensions(-0.2, 0.4, 0.006, 0.01, 0.008).superficial, 50, 1e-13);
}

// Oracle: Schweizer 2009: at 83 deg, 11 % between yielding and pulling, which the gain separates twice.
TEST(Pulleys, SheathHasThePublishedFriction) {
  const double gain = sheath_gain(83 * kDegree);
  EXPECT_NEAR(gain * gain, 1.11, 0.002);
  EXPECT_EQ(sheath_gain(-0.3), 1);
}

}  // namespace
}  // namespace handsim::model
