#include "handsim/model/muscle.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "handsim/core/index.h"
#include "handsim/model/hill_lanes.h"

namespace handsim::model {
namespace {

TendonPath path() {
  TendonPath out;
  out.arms.push_back({0, {0.010, 0.002, -0.001, 0.0005, 0}, -0.2, 1.6});
  out.arms.push_back({1, {-0.004, 0.001, 0, 0, 0}, -0.2, 1.6});
  out.arms.push_back({3, {0.006}, -1, 1});
  out.products.push_back({0, 1, 1, 1, 0.0008});
  out.products.push_back({1, 2, 2, 1, -0.0005});
  return out;
}

Muscle muscle() {
  Muscle out;
  out.name = "m";
  out.path = path();
  out.force = 100;
  out.fibre_length = 0.07;
  out.slack_length = 0.3;
  out.length = 0.37;
  return out;
}

// Oracle: the moment arm is minus the derivative of length; central differences of the excursion, within and
// beyond the range of the polynomials. 1e-6 rad: truncation and rounding are below 1e-10 m.
TEST(TendonPath, ArmsAreTheDerivativeOfTheExcursion) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> angle(-0.6, 2.2);
  const TendonPath tendon = path();
  for (int sample = 0; sample < 200; ++sample) {
    std::vector<double> q(4);
    for (double& each : q) each = angle(random);
    const PathState at = path_state(tendon, q);
    for (std::size_t i = 0; i < tendon.arms.size(); ++i) {
      const auto dof = static_cast<std::size_t>(tendon.arms[i].dof);
      std::vector<double> up = q, down = q;
      up[dof] += 1e-6;
      down[dof] -= 1e-6;
      const double slope = (path_state(tendon, up).excursion - path_state(tendon, down).excursion) / 2e-6;
      EXPECT_NEAR(at.arm[i], slope, 1e-9);
      const double bend = (path_state(tendon, up).arm[i] - path_state(tendon, down).arm[i]) / 2e-6;
      EXPECT_NEAR(at.bend[i], bend, 1e-8);
    }
  }
}

// Oracle: the path itself with the coordinate at its angle: what holding returns, and the rest's excursion,
// are its excursion, and the other arms are as they were.
TEST(TendonPath, HeldAtAnAngleHasTheArmsThatItHasThere) {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> angle(-0.6, 2.2);
  for (const int dof : {0, 1, 3})
    for (int sample = 0; sample < 50; ++sample) {
      const TendonPath whole = path();
      TendonPath held = whole;
      std::vector<double> q(4);
      // Powers of the others are terms of their arms within their range alone.
      for (double& each : q) each = std::clamp(angle(random), -0.2, 1.0);
      q[as_index(dof)] = angle(random);
      const double excursion = hold(held, dof, q[as_index(dof)]);
      const PathState before = path_state(whole, q), after = path_state(held, q);
      ASSERT_EQ(held.arms.size(), whole.arms.size() - 1);
      EXPECT_NEAR(excursion + after.excursion, before.excursion, 1e-16);
      for (std::size_t i = 0, k = 0; i < whole.arms.size(); ++i) {
        if (whole.arms[i].dof == dof) continue;
        EXPECT_EQ(held.arms[k].dof, whole.arms[i].dof);
        EXPECT_NEAR(after.arm[k], before.arm[i], 1e-16);
        EXPECT_NEAR(after.bend[k], before.bend[i], 1e-16);
        ++k;
      }
    }
  TendonPath other = path();
  EXPECT_EQ(hold(other, 2, 0.7), 0);
  EXPECT_EQ(other.arms.size(), 3U);
  EXPECT_EQ(other.products.size(), 2U);
}

// Oracle: Thelen 2003, eqs. 3, 4, 6, 7: 1 at the optimum, 0 at the largest speed of 0.25 + 0.75 a, 1.4 in
// fast lengthening, exp(-0.25 / 0.45) at half a length more, and a passive force of 1 at a strain of 0.6.
TEST(MuscleCurves, HaveTheValuesOfTheirSource) {
  Muscle m = muscle();
  m.length = m.slack_length + m.fibre_length;
  EXPECT_NEAR(tension(m, 0, 0, 1).force, 100, 1e-12);
  EXPECT_NEAR(tension(m, 0, 0, 0.3).force, 30, 1e-12);
  const double top = 10 * m.fibre_length;
  EXPECT_NEAR(tension(m, 0, -top, 1).force, 0, 1e-12);
  EXPECT_NEAR(tension(m, 0, -0.625 * top, 0.5).force, 0, 1e-12);
  EXPECT_NEAR(tension(m, 0, 1e6 * top, 1).force, 140, 1e-3);
  // Concentric, eq. 6 by hand at a quarter of the largest speed: (1 - 0.25) / (1 + 0.25 / 0.25).
  EXPECT_NEAR(tension(m, 0, -0.25 * top, 1).force, 37.5, 1e-9);
  EXPECT_NEAR(isometric_force(m, -0.5 * m.fibre_length), 100 * std::exp(-0.25 / 0.45), 1e-9);
  EXPECT_NEAR(passive_force(m, -0.6 * m.fibre_length), 100, 1e-9);
  EXPECT_EQ(passive_force(m, 0.1 * m.fibre_length), 0);
}

// Oracle: std::exp. Five squarings double the last place's error five times: 32 times a few 1e-16.
TEST(Exponential, IsThatOfTheLibraryToTwentyLastPlaces) {
  double worst = 0;
  for (double y = -5; y <= 5; y += 1e-4) worst = std::max(worst, std::abs(exponential(y) / std::exp(y) - 1));
  EXPECT_LT(worst, 2e-14);
}

// Oracle: the curves of Thelen 2003 written down again with std::exp, and the slope of the speed's factor as
// the greater of tangent and chord. Tolerance: the exponential's error, of a force of 1.
TEST(MuscleCurves, AreThoseOfTheirFormulas) {
  const auto speed = [](double w) {
    const double value = w <= -1 ? 0 : w < 0 ? (1 + w) / (1 - 4 * w) : (1 + 35 * w) / (1 + 25 * w);
    const double tangent = w <= -1 ? 0 : w < 0 ? 5 / std::pow(1 - 4 * w, 2) : 10 / std::pow(1 + 25 * w, 2);
    return std::pair(value, std::max(tangent, w == 0 ? tangent : (value - 1) / w));
  };
  Muscle m = muscle();
  m.pennation = 0.2;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> number(0, 1);
  for (int sample = 0; sample < 2000; ++sample) {
    const double excursion = -0.07 + 0.14 * number(random), a = number(random);
    const double rate = 2 * (number(random) - 0.5);
    const double along = std::max(m.length - excursion - m.slack_length, 1e-3 * m.fibre_length);
    const double length = std::hypot(m.fibre_length * std::sin(0.2), along), cosine = along / length;
    const double l = length / m.fibre_length, per = cosine / m.fibre_length;
    const double active = l < 0.2 || l > 1.8 ? 0 : std::exp(-(l - 1) * (l - 1) / 0.45);
    const double grown = std::exp(5 * std::min(l - 1, 0.6) / 0.6), over = std::exp(5.0) - 1;
    const double passive_slope = l <= 1 ? 0 : 5 / 0.6 * grown / over;
    const double passive = l <= 1 ? 0 : (grown - 1) / over + passive_slope * std::max(0.0, l - 1.6);
    const double top = (0.25 + 0.75 * a) * m.max_speed;
    const auto [value, slope] = speed(rate * per / top);
    const double drag = 0.1 * passive / m.max_speed;
    const double force = a * active * value + passive + drag * rate * per;
    const Tension found = tension(m, excursion, rate, a);
    const double bound = 1e-12 * m.force;
    if (force <= 0) {
      EXPECT_EQ(found.force, 0);
      continue;
    }
    EXPECT_NEAR(found.force, m.force * cosine * force, bound);
    const double stiffness = a * -2 * (l - 1) / 0.45 * active * value + passive_slope;
    EXPECT_NEAR(found.stiffness, m.force * cosine * stiffness * per, bound * per * 10);
    EXPECT_NEAR(found.damping, m.force * cosine * (a * active * slope / top + drag) * per, bound * per);
  }
}

// Oracle: differences of the force. The damping has to be the tangent at least, and the chord to rest: a step
// that is linear by it then does not go past the force at rest.
TEST(MuscleCurves, SlopesBoundTheCurve) {
  const Muscle m = muscle();
  for (const double a : {0.02, 0.4, 1.0})
    for (double rate = -0.5; rate < 0.5; rate += 0.0371) {
      const Tension at = tension(m, 0.004, rate, a);
      if (at.force == 0) continue;
      const double h = 1e-7;
      const double tangent =
          (tension(m, 0.004, rate + h, a).force - tension(m, 0.004, rate - h, a).force) / (2 * h);
      const double chord = (at.force - tension(m, 0.004, 0, a).force) / rate;
      EXPECT_GE(at.damping * (1 + 1e-5), tangent) << a << " " << rate;
      EXPECT_GE(at.damping * (1 + 1e-5), chord) << a << " " << rate;
      const double slope =
          (tension(m, 0.004 - h, rate, a).force - tension(m, 0.004 + h, rate, a).force) / (2 * h);
      EXPECT_NEAR(at.stiffness, slope, 1e-3 * std::abs(slope) + 1e-2);
    }
}

// Oracle: right triangles: fibres, their reach along the tendon and what they are across it; the way back
// from a length; and the sum of reach and tendon is muscle and tendon less the excursion.
TEST(MuscleCurves, FibresAndTendonAddUpToTheMuscle) {
  Muscle m = muscle();
  m.pennation = 0.3;
  const double across = m.fibre_length * std::sin(m.pennation);
  for (const double length : {0.5, 0.8, 1.0, 1.4}) {
    const double excursion = fibre_excursion(m, length * m.fibre_length);
    const Fibre fibre = fibre_at(m, excursion);
    EXPECT_NEAR(fibre.length, length * m.fibre_length, 1e-12);
    const double reach = std::sqrt(fibre.length * fibre.length - across * across);
    EXPECT_NEAR(fibre.cosine, reach / fibre.length, 1e-11);
    EXPECT_NEAR(tendon_length(m, excursion, fibre.length), m.slack_length, 1e-11);
    EXPECT_NEAR(tendon_length(m, excursion, 1.1 * fibre.length) +
                    std::sqrt(std::pow(1.1 * fibre.length, 2) - across * across),
                m.length - excursion, 1e-11);
  }
}

// Oracle: definition of the pieces: values meet where pieces do, slopes where the passive curve goes on along
// its tangent; lengthening starts twice as steep as shortening ends (Thelen 2003, eqs. 6 and 7).
TEST(HillCurves, MeetWhereTheirPiecesDo) {
  constexpr double kClose = 1e-9;
  EXPECT_NEAR(hill_passive(1 + kClose).value, 0, 1e-8);
  EXPECT_NEAR(hill_passive(1.6).value, 1, 1e-13);
  EXPECT_NEAR(hill_passive(1.6 + kClose).value, hill_passive(1.6 - kClose).value, 1e-7);
  EXPECT_NEAR(hill_passive(1.6 + kClose).slope, hill_passive(1.6 - kClose).slope, 1e-6);
  const double top = 7;
  EXPECT_EQ(hill_speed(0.0, top).value, 1);
  EXPECT_NEAR(hill_speed(-kClose, top).value, 1, 1e-8);
  EXPECT_EQ(hill_speed(-top, top).value, 0);
  EXPECT_NEAR(hill_speed(-top + kClose, top).value, 0, 1e-8);
  const double shortens = (1 - hill_speed(-1e-6 * top, top).value) / 1e-6;
  const double lengthens = (hill_speed(1e-6 * top, top).value - 1) / 1e-6;
  EXPECT_NEAR(lengthens / shortens, 2, 1e-3);
}

// Oracle: with a constant excitation of 0 the law is a' = -a (0.5 + 1.5 a) / t, solved by separation:
// a / (0.5 + 1.5 a) = C exp(-0.5 s / t). Backward Euler is first order: halving the step halves the error.
TEST(Activation, FollowsItsLawToFirstOrder) {
  const Muscle m = muscle();
  const double end = 0.06, start = 0.8;
  const double c = start / (0.5 + 1.5 * start) * std::exp(-0.5 * end / m.deactivation_time);
  const double exact = 0.5 * c / (1 - 1.5 * c);
  double errors[2] = {};
  for (int k = 0; k < 2; ++k) {
    const int steps = k == 0 ? 600 : 1200;
    double a = start;
    for (int i = 0; i < steps; ++i) a = next_activation(m, a, 0, end / steps);
    errors[k] = std::abs(a - exact);
  }
  EXPECT_LT(errors[0], 1e-3);
  EXPECT_NEAR(errors[0] / errors[1], 2, 0.05);
}

// Oracle: with a constant excitation of 1 the law is a' = (1 - a) / (t (0.5 + 1.5 a)), by separation
// -1.5 a - 2 ln(1 - a) = s / t + C. First order in the step.
TEST(Activation, RisesByItsLawToFirstOrder) {
  const Muscle m = muscle();
  const double end = 0.03, start = 0.1;
  const auto left = [](double a) { return -1.5 * a - 2 * std::log(1 - a); };
  double errors[2] = {};
  for (int k = 0; k < 2; ++k) {
    const int steps = k == 0 ? 600 : 1200;
    double a = start;
    for (int i = 0; i < steps; ++i) a = next_activation(m, a, 1, end / steps);
    errors[k] = std::abs(left(a) - left(start) - end / m.activation_time);
  }
  EXPECT_LT(errors[0], 5e-3);
  EXPECT_NEAR(errors[0] / errors[1], 2, 0.05);
}

TEST(Activation, StaysWithinZeroAndOneAtAnyStep) {
  const Muscle m = muscle();
  for (const double step : {1e-4, 1e-2, 10.0})
    for (const double from : {0.0, 0.3, 1.0})
      for (const double to : {0.0, 0.5, 1.0}) {
        const double next = next_activation(m, from, to, step);
        EXPECT_GE(next, std::min(from, to));
        EXPECT_LE(next, std::max(from, to));
      }
}

}  // namespace
}  // namespace handsim::model
