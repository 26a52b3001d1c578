// Force over depth of surfaces that stiffen: exponential, table, series, sizes.
#include <gtest/gtest.h>

#include <cmath>

#include "handsim/model/model.h"

namespace handsim::model {
namespace {

std::shared_ptr<const PadLaw> law(ForceCurve curve, double radius = 0) {
  return std::make_shared<const PadLaw>(PadLaw{std::move(curve), {}, radius});
}

Compliance pad(ForceCurve curve, double size = 1) {
  Compliance out;
  out.law = law(std::move(curve));
  out.size = size;
  return out;
}

/// The slope is that of the force, by central differences; the depth of the force is the depth.
void expect_consistent(const Compliance& surface, double depth) {
  const Elastic here = surface.elastic(depth);
  const double h = 1e-9;
  const double slope = (surface.elastic(depth + h).force - surface.elastic(depth - h).force) / (2 * h);
  EXPECT_NEAR(here.slope, slope, 1e-5 * std::abs(slope) + 1e-6) << depth;
  EXPECT_NEAR(surface.depth_of(here.force), depth, 1e-13) << depth;
}

// Oracle: closed form, and the two ways between depth and force that must agree.
TEST(Compliance, ExponentialIsAsInClosedForm) {
  const Compliance surface = pad(ForceCurve::exponential(5.5e-4, 0.27e-3));
  EXPECT_NEAR(surface.elastic(2.5e-3).force, 5.5e-4 * std::expm1(2.5 / 0.27), 1e-12);
  for (const double depth : {-1e-3, 1e-5, 1e-3, 2.5e-3, 5e-3}) expect_consistent(surface, depth);
  // A depth that no pad bears has a finite force.
  EXPECT_TRUE(std::isfinite(surface.elastic(1).force));
  EXPECT_NEAR(surface.depth_of(surface.elastic(1).force), 1, 1e-12);
}

// Oracle: the points themselves; monotony between them; the slopes of the ends beyond.
TEST(Compliance, TableGoesThroughItsPointsAndRises) {
  const Compliance surface = pad(ForceCurve::table({{1e-3, 0.5}, {2e-3, 0.6}, {3e-3, 5}}));
  EXPECT_DOUBLE_EQ(surface.elastic(2e-3).force, 0.6);
  EXPECT_DOUBLE_EQ(surface.elastic(3e-3).force, 5);
  for (int i = -10; i < 100; ++i) {
    EXPECT_GT(surface.elastic(4e-5 * (i + 1)).force, surface.elastic(4e-5 * i).force);
    if (i % 25 != 0) expect_consistent(surface, 4e-5 * i);
  }
  EXPECT_NEAR(surface.elastic(4e-3).force, 5 + 1e-3 * surface.elastic(3e-3).slope, 1e-12);
  EXPECT_NEAR(surface.elastic(-1e-3).force, -0.5, 1e-12);
}

// Oracle: the definition: the same force, and depths add.
TEST(Compliance, DepthsOfSurfacesInSeriesAdd) {
  const Compliance soft = pad(ForceCurve::exponential(5.5e-4, 0.27e-3)),
                   hard = pad(ForceCurve::exponential(2e-2, 0.1e-3), 1.7),
                   table = pad(ForceCurve::table({{1e-3, 0.5}, {2e-3, 3}})), spring{2000, 0};
  for (const auto& [a, b] : {std::pair(soft, hard), std::pair(soft, spring), std::pair(spring, hard),
                             std::pair(table, soft), std::pair(soft, soft)}) {
    const Compliance both = in_series(a, b);
    for (const double force : {1e-3, 0.3, 5.0, 120.0}) {
      const double depth = a.depth_of(force) + b.depth_of(force);
      EXPECT_NEAR(both.elastic(depth).force, force, 1e-9 * force);
      expect_consistent(both, depth);
    }
    EXPECT_LT(both.elastic(-1e-4).force, 0);
  }
}

// Oracle: similarity: m times the radius has m^2 the force at m times the depth.
TEST(Compliance, PadsOfTwiceTheRadiusPressFourTimesAsHardAtTwiceTheDepth) {
  const ForceCurve curve = ForceCurve::exponential(5.5e-4, 0.27e-3);
  EXPECT_NEAR(pad(curve, 2).elastic(4e-3).force, 4 * pad(curve).elastic(2e-3).force, 1e-12);
}

// Oracle: closed form: the press that lasts has its share of the force.
TEST(Compliance, SecantIsThatOfAPressThatLasts) {
  Compliance surface;
  surface.law = std::make_shared<const PadLaw>(
      PadLaw{ForceCurve::exponential(5.5e-4 / 0.15, 0.27e-3), {{4e-3, 0.65}, {0.07, 0.15}, {1.4, 0.05}}, 0});
  const double depth = surface.depth_of(5.2 / 0.15);
  EXPECT_NEAR(surface.secant(5.2), 5.2 / depth, 1e-9);
}

// Oracle: F = p0 pi a^2 / 2 with p = p0 (1 - r^2 / a^2), and the moment of friction over that disc, by
// summing.
TEST(Compliance, SpinningFrictionIsThatOfAParaboloidOfPressure) {
  Material surface;
  surface.friction = 0.8;
  surface.spins_by_area = true;
  surface.compliance = Compliance{3000, 0};
  surface.compliance->radius = 8e-3;
  const double depth = 2.03e-3, a = std::sqrt(2 * 8e-3 * depth);
  double force = 0, moment = 0;
  constexpr int kRings = 100000;
  for (int i = 0; i < kRings; ++i) {
    const double r = a * (i + 0.5) / kRings, push = (1 - r * r / (a * a)) * r;
    force += push;
    moment += 0.8 * push * r;
  }
  EXPECT_NEAR(surface.spinning(0.8, depth), moment / force, 1e-9);
  // People's area at 1 N: about 1 cm2.
  EXPECT_NEAR(M_PI * a * a, 1e-4, 3e-6);
}

TEST(Compliance, FrictionOverLoadIsAPowerWithinItsBounds) {
  const FrictionOverLoad over{-0.3, std::pow(2.0, 0.3), 0.5, 2};
  EXPECT_NEAR(over.factor(2), 1, 1e-12);
  EXPECT_NEAR(over.factor(4), std::pow(2.0, -0.3), 1e-12);
  EXPECT_EQ(over.factor(0), 2);
  EXPECT_EQ(over.factor(1e6), 0.5);
}

}  // namespace
}  // namespace handsim::model
