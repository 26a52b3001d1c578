// The slider-crank as a Model, with the four methods, compared with its exact reduction to one degree of
// freedom.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/slider_crank_errors.h"
#include "support/sanitized.h"

namespace handsim::engine {
namespace {

using handsim::test::energy;
using handsim::test::largest_gap;
using model::Effect;
using study::SliderCrankSpec;
using test::run;
using test::settings;
using test::SliderCrankErrors;

// Oracle: the reduction; the bounds are the requirements for a reference.
TEST(SliderCrank, OfStabilisedGearIsExactToAHundredNanometresPerSecondOverFiveSeconds) {
  const SliderCrankErrors errors = run(SliderCrankSpec::iftomm(), DaeMethod::stabilised_gear, 1e-3, 5);
  RecordProperty("rms_velocity_error", std::to_string(errors.velocity * 1e9) + " nm/s");
  EXPECT_LT(errors.velocity, 1e-7);
  EXPECT_LT(errors.position, 1e-7);
  EXPECT_LT(errors.gap, 1e-10);
  EXPECT_LT(errors.energy, 1e-8);
}

// Oracle: the reduction, driven to 45 rad/s by a torque.
TEST(SliderCrank, OfStabilisedGearIsExactUnderTorque) {
  const SliderCrankErrors errors =
      run(SliderCrankSpec::constant_torque(), DaeMethod::stabilised_gear, 1e-3, 2);
  EXPECT_LT(errors.velocity, 1e-6);
  EXPECT_LT(errors.gap, 1e-10);
}

// Oracle: error control: a smaller tolerance gives a smaller error.
TEST(SliderCrank, IsMoreExactWithASmallerTolerance) {
  HANDSIM_SKIP_WITH_SANITIZER("the same code as in the test before, over more steps");
  const auto error = [](double tolerance) {
    return run(SliderCrankSpec::iftomm(), DaeMethod::stabilised_gear, 1e-3, 1, tolerance).velocity;
  };
  const double coarse = error(1e-5), middle = error(1e-7), fine = error(1e-9);
  EXPECT_LT(middle, 0.1 * coarse);
  EXPECT_LT(fine, 0.1 * middle);
}

// Oracle: the exact solution does not depend on the step of the output.
TEST(SliderCrank, DoesNotDependOnTheStepOfOutputInStabilisedGear) {
  HANDSIM_SKIP_WITH_SANITIZER("the same code as in the test before, over more steps");
  EXPECT_LT(run(SliderCrankSpec::iftomm(), DaeMethod::stabilised_gear, 0.02, 1).velocity, 1e-7);
}

/// Slope of the error between two steps.
double order(Method method, double coarse, double fine) {
  const auto error = [&](double step) { return run(SliderCrankSpec::iftomm(), method, step, 0.2).velocity; };
  return std::log(error(coarse) / error(fine)) / std::log(coarse / fine);
}

// Oracle: orders of convergence of the methods, over 0.2 s.
TEST(SliderCrank, ConvergesAtTheOrderOfEachFixedStepMethod) {
  EXPECT_NEAR(order(DaeMethod::lagrange_penalty, 1e-3, 2.5e-4), 2, 0.15);
  EXPECT_NEAR(order(DaeMethod::euler_linearised, 5e-4, 1e-4), 1, 0.15);
  EXPECT_NEAR(order(DaeMethod::euler_projected, 5e-4, 1e-4), 1, 0.15);
}

// Oracle: rounding; positions are projected after every step.
TEST(SliderCrank, HasNoGapInEulerProjectedAndLagrangePenalty) {
  EXPECT_LT(run(SliderCrankSpec::iftomm(), DaeMethod::euler_projected, 1e-3, 2).gap, 1e-12);
  EXPECT_LT(run(SliderCrankSpec::iftomm(), DaeMethod::euler_projected, 1e-2, 2).gap, 1e-12);
  EXPECT_LT(run(SliderCrankSpec::iftomm(), DaeMethod::lagrange_penalty, 1e-3, 2).gap, 1e-11);
}

/// Largest gap over a second; checks that the motion passes both dead centres.
double gap_through_dead_centres(const model::Model& model, Method method, double step) {
  const auto engine = make_engine(model, settings({Effect::gravity}, step, method));
  double gap = 0, low = 1, high = -1;
  for (int i = 0; i < static_cast<int>(std::lround(1 / step)); ++i) {
    engine->step({});
    gap = std::max(gap, largest_gap(model, engine->state()));
    const double x = engine->state().bodies[handsim::test::kSlider].p.x();
    low = std::min(low, x), high = std::max(high, x);
    EXPECT_TRUE(std::isfinite(x));
  }
  EXPECT_LT(low, 0.23);
  EXPECT_GT(high, 0.37);
  return gap;
}

// Oracle: the contract: 0.01 mm at 1 ms. Crank and rod are collinear twice a revolution, and three hinges
// with a slider have three redundant constraints.
TEST(RedundantSliderCrank, PassesDeadCentreWithClosedJoints) {
  const model::Model model = handsim::test::planar_slider_crank();
  EXPECT_LT(gap_through_dead_centres(model, DaeMethod::stabilised_gear, 1e-3), 1e-10);
  EXPECT_LT(gap_through_dead_centres(model, DaeMethod::lagrange_penalty, 1e-3), 1e-11);
  EXPECT_LT(gap_through_dead_centres(model, DaeMethod::euler_projected, 1e-3), 1e-12);
}

// Oracle: the gap is that of the mechanism without redundancy, because the solution is a least-squares one.
TEST(RedundantSliderCrank, StaysClosedInEulerLinearised) {
  EXPECT_LT(gap_through_dead_centres(handsim::test::planar_slider_crank(), DaeMethod::euler_linearised, 1e-3),
            1e-4);
}

// Oracle: conservation of energy, with three redundant rows and any orientation of the plane.
TEST(RedundantSliderCrank, KeepsItsEnergyInStabilisedGear) {
  for (const Quat& tilt : {Quat::Identity(), rotation_quaternion({0.7, -0.4, 1.1})}) {
    const model::Model model = handsim::test::planar_slider_crank(tilt);
    const auto engine = make_engine(model, settings({Effect::gravity}, 1e-3, DaeMethod::stabilised_gear));
    const double start = energy(model, engine->state());
    double gap = 0;
    for (int i = 0; i < 1000; ++i) {
      engine->step({});
      gap = std::max(gap, largest_gap(model, engine->state()));
    }
    EXPECT_NEAR(energy(model, engine->state()), start, 1e-8);
    EXPECT_LT(gap, 1e-10);
  }
}

// Oracle: at ten times the speed, joints stay closed and numbers finite.
TEST(SliderCrank, StaysClosedAtTenTimesTheSpeed) {
  HANDSIM_SKIP_WITH_SANITIZER("the same code as in the test before, over more steps");
  SliderCrankSpec spec = SliderCrankSpec::iftomm();
  spec.speed = 60;
  EXPECT_LT(run(spec, DaeMethod::stabilised_gear, 1e-3, 0.5).gap, 1e-10);
  EXPECT_LT(run(spec, DaeMethod::lagrange_penalty, 1e-3, 0.5).gap, 1e-5);
  EXPECT_LT(run(spec, DaeMethod::euler_projected, 1e-3, 0.5).gap, 1e-12);
}

// Oracle: the contract: a start with a gap of 1 mm is closed, and a note reports the gap.
TEST(SliderCrank, IsClosedAtTheStartWithANote) {
  model::Model model = handsim::test::slider_crank(SliderCrankSpec::iftomm());
  model.joints[3].parent_frame.p.x() += 1e-3;
  const auto engine = make_engine(model, settings({Effect::gravity}, 1e-3, DaeMethod::stabilised_gear));
  EXPECT_LT(largest_gap(model, engine->state()), 1e-12);
  ASSERT_EQ(engine->notes().size(), 1U);
  EXPECT_NE(engine->notes()[0].find("0.001 m"), std::string::npos);
}

}  // namespace
}  // namespace handsim::engine
