// The slider-crank on the articulated engine: a loop cut and held, against its exact reduction.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/slider_crank_errors.h"
#include "handsim/engine/articulated/dynamics/topology.h"

namespace handsim::engine {
namespace {

using handsim::test::energy;
using handsim::test::largest_gap;
using model::Effect;
using study::SliderCrankSpec;
using test::run;
using test::settings;
using test::SliderCrankErrors;

// Oracle: the choice of cuts: 3 rows of a ball, where the model closes the loop with the 4 of a universal
// joint.
TEST(ArticulatedSliderCrank, IsCutAtItsBallJoint) {
  const model::Model model = handsim::test::slider_crank(SliderCrankSpec::iftomm());
  const articulated::Topology topology = articulated::make_topology(model);
  ASSERT_EQ(topology.cuts.size(), 1U);
  EXPECT_EQ(model.joints[static_cast<std::size_t>(topology.cuts[0].joint)].name, "pin");
  EXPECT_EQ(topology.nodes.size(), 4U);
  EXPECT_EQ(topology.islands, 1);
}

// Oracle: the reduction; loops drift by rounding alone.
TEST(ArticulatedSliderCrank, IsFollowedToItsToleranceOverFiveSeconds) {
  for (const double tolerance : {1e-6, 1e-8, 1e-10}) {
    const SliderCrankErrors errors =
        run(SliderCrankSpec::iftomm(), ArticulatedMethod::dormand_prince, 1e-2, 5, tolerance);
    EXPECT_LT(errors.velocity, tolerance);
    EXPECT_LT(errors.gap, 1e-12);
    EXPECT_LT(errors.energy, tolerance);
  }
}

// Oracle: the reduction, driven to 45 rad/s.
TEST(ArticulatedSliderCrank, IsFollowedUnderATorque) {
  const SliderCrankErrors errors =
      run(SliderCrankSpec::constant_torque(), ArticulatedMethod::dormand_prince, 1e-2, 2);
  EXPECT_LT(errors.velocity, 1e-9 * 10);
  EXPECT_LT(errors.gap, 1e-12);
}

// Oracle: order of convergence against the reduction.
TEST(ArticulatedSliderCrank, HasTheOrdersOfItsMethods) {
  const auto order = [](Method method, double coarse, double fine) {
    const double a = run(SliderCrankSpec::iftomm(), method, coarse, 1).velocity;
    const double b = run(SliderCrankSpec::iftomm(), method, fine, 1).velocity;
    return std::log(a / b) / std::log(coarse / fine);
  };
  EXPECT_NEAR(order(ArticulatedMethod::rk4, 2.5e-4, 1.25e-4), 4, 0.2);
  EXPECT_NEAR(order(ArticulatedMethod::semi_implicit_euler, 2e-4, 2e-5), 1, 0.15);
}

// Oracle: the loop itself, at a step at which ODE's joints come apart by millimetres.
TEST(ArticulatedSliderCrank, StaysClosedAtAnyStep) {
  for (const double step : {1e-3, 5e-3, 1e-2})
    EXPECT_LT(run(SliderCrankSpec::iftomm(), ArticulatedMethod::semi_implicit_euler, step, 2).gap, 1e-12)
        << step;
}

// Oracle: energy, and the loop, through dead centres with three dependent rows; turned, so that no zero is
// exact.
TEST(ArticulatedSliderCrank, TakesDependentRowsThroughDeadCentres) {
  const model::Model model = handsim::test::planar_slider_crank(rotation_quaternion({0.3, 0.5, -0.2}));
  const auto engine = make_engine(model, settings({}, 1e-2, ArticulatedMethod::dormand_prince));
  const double start = model::kinetic_energy(model, engine->state());
  double gap = 0;
  for (int i = 0; i < 300; ++i) {
    engine->step({});
    gap = std::max(gap, largest_gap(model, engine->state()));
    EXPECT_NEAR(model::kinetic_energy(model, engine->state()), start, 1e-9);
  }
  EXPECT_LT(gap, 1e-12);
}

TEST(ArticulatedSliderCrank, HoldsEveryKindOfCutJoint) {
  for (const model::JointKind kind : {model::JointKind::hinge, model::JointKind::universal,
                                      model::JointKind::ball, model::JointKind::slider}) {
    model::Model model = model::make_model();
    model.gravity = {1, 2, -9};
    for (int i = 0; i < 3; ++i)
      test::add_body(model, test::body("b" + std::to_string(i), 0.1, {1e-4, 2e-4, 2.5e-4}));
    // Chain: world - ball - 1 - universal - 2 - ball - 3, and 3 tied to 1 by the joint in question.
    test::add_joint(model, "a", model::JointKind::ball, 0, 1, {}, {Vec3(0, 0, 0.1), Quat::Identity()}, {});
    test::add_joint(model, "b", model::JointKind::universal, 1, 2, {Vec3(0, 0, -0.1), Quat::Identity()},
                    {Vec3(0, 0.05, 0.1), Quat::Identity()}, {Vec3::UnitX(), Vec3::UnitY()});
    test::add_joint(model, "c", model::JointKind::ball, 2, 3, {Vec3(0, 0.05, -0.1), Quat::Identity()},
                    {Vec3(0.05, 0, 0.1), Quat::Identity()}, {});
    model::Joint tie;
    tie.name = "d";
    tie.kind = kind;
    tie.parent = 3;
    tie.child = 1;
    tie.parent_frame = {Vec3(0.02, 0.03, 0.01), rotation_quaternion({0.4, 0.2, 0.1})};
    tie.child_frame = model.bodies[1].zero_pose.inverse() * model.bodies[3].zero_pose * tie.parent_frame;
    const int axes = kind == model::JointKind::ball ? 0 : model::dof_count(kind);
    for (int i = 0; i < axes; ++i) {
      tie.axes.emplace_back();
      tie.axes.back().name = "axis" + std::to_string(i);
      tie.axes.back().axis = i == 0 ? Vec3::UnitX() : Vec3::UnitZ();
    }
    tie.first_dof = model.dof_count();
    tie.closes_loop = true;
    model.joints.push_back(tie);
    model.bodies[1].initial_angular_velocity = Vec3(1, 2, 3);
    // A start whose velocities agree with the joints.
    const model::State begin =
        make_engine(model, settings({}, 1e-2, ArticulatedMethod::dormand_prince))->state();
    const auto result = [&](Method method) {
      const auto engine = make_engine(model, settings({Effect::gravity}, 1e-2, method));
      engine->set_state(begin);
      const double start = energy(model, engine->state());
      test::run(*engine, 30);
      EXPECT_LT(largest_gap(model, engine->state()), 1e-9);
      EXPECT_NEAR(energy(model, engine->state()), start, 1e-7);
      return engine->state();
    };
    // Oracle: another engine, another formulation. 1e-7: its tolerance over 0.3 s.
    const model::State mine = result(ArticulatedMethod::dormand_prince),
                       other = result(DaeMethod::stabilised_gear);
    for (std::size_t i = 1; i < mine.bodies.size(); ++i)
      EXPECT_LT((mine.bodies[i].p - other.bodies[i].p).norm(), 1e-7) << static_cast<int>(kind);
  }
}

}  // namespace
}  // namespace handsim::engine
