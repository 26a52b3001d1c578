#include "handsim/model/spline.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <gtest/gtest.h>

namespace handsim::model {
namespace {

// Oracle: sin t and its derivatives; the spline's errors fall with h^4, h^3, h^2 away from the ends.
TEST(CubicSpline, FollowsValueRateAndAcceleration) {
  const auto error = [](double step) {
    std::vector<double> times, values;
    for (double t = 0; t < 6.3; t += step) times.push_back(t), values.push_back(std::sin(t));
    const CubicSpline spline(times, values, 1);
    double y = 0, dy = 0, ddy = 0, worst = 0;
    for (double t = 2; t < 4; t += 0.01) {
      spline.at(t, {&y, 1}, {&dy, 1}, {&ddy, 1});
      worst = std::max(
          {worst, std::abs(y - std::sin(t)), std::abs(dy - std::cos(t)), std::abs(ddy + std::sin(t))});
    }
    return worst;
  };
  const double coarse = error(0.1), fine = error(0.05);
  EXPECT_LT(coarse, 2e-3);
  EXPECT_NEAR(coarse / fine, 4, 0.8);
}

/// A cubic B-spline of five knots and its derivatives, by divided differences of (s - t)^3 where s > t.
std::array<double, 3> bell(const std::array<double, 5>& knots, double t) {
  std::array<double, 3> out{};
  for (const double s : knots) {
    double others = 1;
    for (const double other : knots)
      if (other != s) others *= s - other;
    const double beyond = std::max(0.0, s - t);
    out[0] += beyond * beyond * beyond / others;
    out[1] -= 3 * beyond * beyond / others;
    out[2] += 6 * beyond / others;
  }
  return out;
}

// Oracle: a B-spline, which is the natural spline of its own values: piecewise cubic, smooth to the second
// derivative, which is 0 at both ends. Tolerance: rounding of the divided differences.
TEST(CubicSpline, OfTheKnotsOfABSplineIsTheBSpline) {
  constexpr std::array<double, 5> kKnots = {-0.7, -0.2, 0.5, 0.8, 1.9}, kOthers = {-0.7, 0.1, 0.2, 1, 1.9};
  std::vector<double> times(kKnots.begin(), kKnots.end()), values;
  times.insert(times.end(), kOthers.begin() + 1, kOthers.end() - 1);
  std::ranges::sort(times);
  // Two quantities side by side, so that none is taken for the other.
  for (const double t : times) values.insert(values.end(), {bell(kKnots, t)[0], -3 * bell(kOthers, t)[0]});
  const CubicSpline spline(times, values, 2);
  for (int i = 0; i <= 260; ++i) {
    const double t = i == 260 ? kKnots.back() : kKnots.front() + 0.01 * i;
    std::array<double, 2> value{}, rate{}, acceleration{};
    spline.at(t, value, rate, acceleration);
    const auto a = bell(kKnots, t), b = bell(kOthers, t);
    EXPECT_NEAR(value[0], a[0], 1e-13) << t;
    EXPECT_NEAR(rate[0], a[1], 1e-12) << t;
    EXPECT_NEAR(acceleration[0], a[2], 1e-11) << t;
    EXPECT_NEAR(value[1], -3 * b[0], 1e-13) << t;
    EXPECT_NEAR(rate[1], -3 * b[1], 1e-12) << t;
    EXPECT_NEAR(acceleration[1], -3 * b[2], 1e-11) << t;
  }
}

// Oracle: definition; at rest at the value of the nearest end outside, a line between two samples, and at the
// last sample the rate with which the motion arrives.
TEST(CubicSpline, RestsBeyondItsEnds) {
  const CubicSpline one({2}, {5}, 1), two({2, 4}, {5, 9}, 1);
  double value = 0, rate = 9, acceleration = 9;
  for (const double t : {1.0, 2.0, 3.0}) {
    one.at(t, {&value, 1}, {&rate, 1}, {&acceleration, 1});
    EXPECT_EQ(value, 5) << t;
    EXPECT_EQ(rate, 0) << t;
    EXPECT_EQ(acceleration, 0) << t;
  }
  const double expected[][3] = {{1.9, 5, 0}, {2, 5, 2}, {2.5, 6, 2}, {4, 9, 2}, {4.1, 9, 0}};
  for (const auto& [t, want, slope] : expected) {
    two.at(t, {&value, 1}, {&rate, 1}, {&acceleration, 1});
    EXPECT_EQ(value, want) << t;
    EXPECT_EQ(rate, slope) << t;
    EXPECT_EQ(acceleration, 0) << t;
  }
}

}  // namespace
}  // namespace handsim::model
