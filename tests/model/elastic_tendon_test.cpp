#include "handsim/model/elastic_lanes.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "support/thelen_curves.h"

namespace handsim::model {
namespace {

using handsim::test::long_flexor;
using handsim::test::resting_tension;
using handsim::test::tendon_at;

// Oracle: the equilibrium of the published curves by bisection. Tolerance: 1e-9 of the largest force.
TEST(ElasticTendon, PullsAsItsFibresAtRest) {
  for (const double strain : {0.01, 0.049, 0.2})
    for (const double activation : {0.0, 0.01, 0.3, 1.0})
      for (const double excursion : {-0.03, -0.01, 0.0, 0.02, 0.05}) {
        const Muscle m = long_flexor(strain);
        EXPECT_NEAR(at_rest(m, excursion, activation).force, resting_tension(m, excursion, activation),
                    1e-9 * m.force)
            << strain << " " << activation << " " << excursion;
      }
}

// Oracle: fibres longer than the optimal length alone pull at rest; others leave the tendon slack.
TEST(ElasticTendon, CarriesNothingWhereItIsSlack) {
  const Muscle m = long_flexor(0.049);
  const RestingMuscle rest = at_rest(m, 0.01, 0);
  EXPECT_EQ(rest.force, 0);
  EXPECT_NEAR(rest.fibre_length, fibre_at(m, 0.01).length, 1e-15);
  EXPECT_EQ(tendon_curve(-0.3).value, 0);
  EXPECT_NEAR(tendon_curve(1.0).value, 1, 1e-13);
}

// Oracle: Thelen 2003, eq. 5 and its constants: the toe ends at 0.609 of the strain with 0.33 of the force,
// and goes over without a corner into a line of slope 1.712.
TEST(ElasticTendon, HasTheToeOfItsSource) {
  EXPECT_NEAR(hill::kToe, 0.609, 5e-4);
  for (const double side : {-1e-9, 0.0, 1e-9}) {
    EXPECT_NEAR(tendon_curve(hill::kToe + side).value, 0.33, 2e-9);
    EXPECT_NEAR(tendon_curve(hill::kToe + side).slope, 1.712, 5e-4);
  }
  const Muscle m = long_flexor(0.05);
  for (double s = -0.1; s < 1.4; s += 0.01)
    EXPECT_NEAR(m.force * tendon_curve(s).value, tendon_at(m, s * 0.05 * m.slack_length), 1e-12 * m.force)
        << s;
}

/// A muscle somewhere in a step of 1 ms: its fibres from a reach, to a tendon that is taut at another.
ElasticStep<double> step_of(const Muscle& m, std::mt19937& random) {
  std::uniform_real_distribution<double> number(0, 1);
  const double taut = (0.3 + 1.6 * number(random)) * m.fibre_length;
  const double start = taut * (0.9 + 0.12 * number(random)), a = number(random);
  return {per_stretch(m), taut, start, 1e-3, 1e3, a < 0.2 ? 0 : a};
}

// Oracle: a rigid tendon, which has the same fibres at a reach and speed; central differences of the pull by
// the reach, off its kinks; and the meaning of fibres_pull(): the force is above 0. A step of 1e-6 of the
// length has errors of 1e-9 of the slope, and rounding.
TEST(ElasticFibres, PullAsThoseOfARigidTendonWithTheSlopeOfTheirPull) {
  std::mt19937 random(2);
  const Muscle m = long_flexor(0.049);
  const HillConstants<double> hill = hill_constants(m);
  const double h = 1e-6 * m.fibre_length;
  int compared = 0, slack = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const ElasticStep<double> of = step_of(m, random);
    std::uniform_real_distribution<double> reach_of(0.97 * of.start, 1.03 * of.start);
    const double reach = reach_of(random);
    const auto at_reach = [&](double w) { return elastic_fibres(hill, of, w); };
    const ElasticFibres<double> found = at_reach(reach), up = at_reach(reach + h), down = at_reach(reach - h);
    EXPECT_EQ(fibres_pull(hill, of, reach), found.force > 0);
    const double rate = (reach - of.start) * of.per_step;
    EXPECT_NEAR(found.force, tension(m, hill.reach - reach, rate, of.activation).force, 1e-12 * m.force);
    slack += found.force == 0 ? 1 : 0;
    const double l = std::sqrt(hill.height + reach * reach) / m.fibre_length;
    const double top = (0.25 + 0.75 * of.activation) * m.max_speed;
    const double speed = rate / m.fibre_length;
    bool kink = up.force == 0 || down.force == 0 || std::abs(speed) < 0.05 || std::abs(speed + top) < 0.2;
    for (const double corner : {0.2, 1.0, 1.6, 1.8}) kink = kink || std::abs(l - corner) < 1e-4;
    if (kink) continue;
    ++compared;
    const double slope = (up.force - down.force) / (2 * h);
    EXPECT_NEAR(found.slope, slope, 1e-5 * (std::abs(slope) + m.force / m.fibre_length)) << l << " " << speed;
  }
  EXPECT_GT(compared, 800);
  EXPECT_GT(slack, 50);
}

// Oracle: the equation that a step solves, put to its solution: the tendon's tension, by the published curve
// at the reach found, is that of the fibres at their speed. Tolerance: Newton's last step squared.
TEST(ElasticTendon, PullsAsItsFibresAtTheEndOfAStep) {
  std::mt19937 random(6);
  int taut = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const Muscle m = long_flexor(trial % 2 == 0 ? 0.01 : 0.1);
    const HillConstants<double> hill = hill_constants(m);
    const ElasticStep<double> of = step_of(m, random);
    const ElasticPull<double> found = elastic_pull(hill, of);
    const double tension = tendon_at(m, of.taut - found.reach);
    EXPECT_NEAR(found.force, tension, 1e-7 * m.force) << trial;
    if (found.force == 0) continue;
    ++taut;
    // Across the active curve's ends the fibres' pull jumps.
    const double l = std::sqrt(hill.height + found.reach * found.reach) / m.fibre_length;
    if (std::abs(l - 0.2) < 1e-6 || std::abs(l - 1.8) < 1e-6) continue;
    EXPECT_NEAR(elastic_fibres(hill, of, found.reach).force, tension, 1e-5 * m.force) << trial;
  }
  EXPECT_GT(taut, 200);
}

// Oracle: central differences of tension and reach by the length of muscle and tendon, at rest on the rising
// side of the active curve, where fibres without pennation have no slope that the step leaves out.
TEST(ElasticTendon, HasTheStiffnessOfFibresAndTendonInSeries) {
  Muscle m = long_flexor(0.049);
  m.pennation = 0;
  const HillConstants<double> hill = hill_constants(m);
  for (const double activation : {0.1, 0.6})
    for (const double share : {0.75, 0.85, 0.95}) {
      const auto at_length = [&](double taut) {
        return elastic_pull(hill, ElasticStep<double>{per_stretch(m), taut, taut, 0, 0, activation});
      };
      const double taut = share * m.fibre_length, h = 1e-5 * m.fibre_length;
      const ElasticPull<double> found = at_length(taut), up = at_length(taut + h), down = at_length(taut - h);
      EXPECT_GT(found.stiffness, 10);
      EXPECT_NEAR(found.stiffness, (up.force - down.force) / (2 * h), 1e-4 * found.stiffness);
      EXPECT_NEAR(found.share, (up.reach - down.reach) / (2 * h), 1e-4);
    }
}

}  // namespace
}  // namespace handsim::model
