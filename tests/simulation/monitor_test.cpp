#include "handsim/simulation/monitor.h"

#include <gtest/gtest.h>

#include <cmath>

#include "handsim/model/kinematics.h"

namespace handsim::simulation {
namespace {

constexpr double kStep = 1e-3;

/// A body on a hinge about z with stops at +-1 rad.
model::Model hinge() {
  model::Model model = model::make_model();
  model::Body body;
  body.name = "b";
  model.bodies.push_back(body);
  model::Joint joint;
  joint.name = "j";
  joint.child = 1;
  joint.axes.push_back({"a", Vec3::UnitZ(), model::Stop{-1, 1, 0, 1}, {}, 0});
  model.joints.push_back(joint);
  return model;
}

model::State at(const model::Model& model, double angle, double rate, double time) {
  model::State state = model::state_at(model, std::vector<double>{angle});
  state.bodies[1].w = {0, 0, rate};
  state.time = time;
  return state;
}

TEST(Monitor, ExcusesWhatOneStepAtTheImpactRateExplainsAndNoMore) {
  const model::Model model = hinge();
  Monitor monitor(model, kStep, true);
  // 20 rad/s carries 0.02 rad in a step: an overshoot of 0.015 is excused, one of 0.035 by all but 0.02.
  monitor.look(at(model, 0.995, 20, 0.001));
  monitor.look(at(model, 1.015, 20, 0.002));
  EXPECT_EQ(monitor.stop_overshoot().value, 0);
  monitor.look(at(model, 1.035, 20, 0.003));
  EXPECT_NEAR(monitor.stop_overshoot().value, 0.035 - 0.02, 2e-6);
  EXPECT_EQ(monitor.stop_overshoot().time, 0.003);
  EXPECT_EQ(monitor.stop_overshoot().where, "j.a");
  EXPECT_NEAR(monitor.stop_rest(at(model, -1.25, 0, 1)).value, 0.25, 1e-12);
}

// A joint far from its stops is not worked out at each step; it must still be caught when it gets there.
TEST(Monitor, CatchesAnOvershootAfterALongWay) {
  const model::Model model = hinge();
  Monitor monitor(model, kStep, true);
  const double rate = -3;
  for (int i = 0; i <= 400; ++i) monitor.look(at(model, rate * kStep * i, rate, kStep * i));
  // -1.2 rad: 0.2 beyond the stop, of which one step explains 0.003.
  EXPECT_NEAR(monitor.stop_overshoot().value, 0.2 - 0.003, 2e-6);
}

TEST(Monitor, WatchesNoStopsThatAreNotInForce) {
  const model::Model model = hinge();
  Monitor monitor(model, kStep, false);
  monitor.look(at(model, 2, 0, 0));
  EXPECT_EQ(monitor.stop_overshoot().value, 0);
}

TEST(Monitor, FindsTheLargestGapAndWhen) {
  const model::Model model = hinge();
  Monitor monitor(model, kStep, true);
  model::State apart = at(model, 0, 0, 0.5);
  apart.bodies[1].p = {3e-4, 0, 4e-4};
  monitor.look(apart);
  monitor.look(at(model, 0, 0, 0.6));
  EXPECT_NEAR(monitor.joint_gap().value, 5e-4, 1e-18);
  EXPECT_EQ(monitor.joint_gap().time, 0.5);
  EXPECT_EQ(monitor.joint_gap().where, "j");
}

}  // namespace
}  // namespace handsim::simulation
