#include "handsim/simulation/watch/monitor.h"

#include <gtest/gtest.h>

#include <cmath>

#include "handsim/model/kinematics.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"

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
  joint.axes.push_back({"a", Vec3::UnitZ(), model::Stop{-1, 1, 0}, {}, 0});
  model.joints.push_back(joint);
  return model;
}

model::State at(const model::Model& model, double angle, double rate, double time) {
  model::State state = model::state_at(model, std::vector<double>{angle});
  state.bodies[1].w = {0, 0, rate};
  model::update_coordinates(model, state);
  state.time = time;
  return state;
}

TEST(Monitor, ExcusesWhatOneStepAtTheImpactRateExplainsAndNoMore) {
  const model::Model model = hinge();
  Monitor monitor(model, kStep, true);
  // 20 rad/s carries 0.02 rad in a step: an overshoot of 0.015 is excused, one of 0.035 by all but 0.02.
  monitor.update(at(model, 0.995, 20, 0.001));
  monitor.update(at(model, 1.015, 20, 0.002));
  EXPECT_EQ(monitor.stop_overshoot().value, 0);
  monitor.update(at(model, 1.035, 20, 0.003));
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
  for (int i = 0; i <= 400; ++i) monitor.update(at(model, rate * kStep * i, rate, kStep * i));
  // -1.2 rad: 0.2 beyond the stop, of which one step explains 0.003.
  EXPECT_NEAR(monitor.stop_overshoot().value, 0.2 - 0.003, 2e-6);
}

TEST(Monitor, WatchesNoStopsThatAreNotInForce) {
  const model::Model model = hinge();
  Monitor monitor(model, kStep, false);
  monitor.update(at(model, 2, 0, 0));
  EXPECT_EQ(monitor.stop_overshoot().value, 0);
}

TEST(Monitor, FindsTheLargestGapAndWhen) {
  const model::Model model = hinge();
  Monitor monitor(model, kStep, true);
  model::State apart = at(model, 0, 0, 0.5);
  apart.bodies[1].p = {3e-4, 0, 4e-4};
  monitor.update(apart);
  monitor.update(at(model, 0, 0, 0.6));
  EXPECT_NEAR(monitor.joint_gap().value, 5e-4, 1e-18);
  EXPECT_EQ(monitor.joint_gap().time, 0.5);
  EXPECT_EQ(monitor.joint_gap().where, "j");
}

/// A ball of 40 mm radius in a block whose top is at z = 0.
scene::Scene ball_in_block(double depth, const std::string& rest) {
  return scene::compile_scene(parse_yaml(
      "objects:\n"
      "  - {name: block, shape: box, edges: [0.2, 0.2, 0.1], static: true, position: [0, 0, -0.05]}\n"
      "  - {name: ball, shape: sphere, radius: 0.04, mass: 0.5, position: [0, 0, " +
          std::to_string(0.04 - depth) + "]}\nduration: 1\n" + rest,
      test::in_source("config/test.yaml")));
}

Peak deepest(const scene::Scene& scene) {
  Simulation simulation(scene);
  for (long i = 0; i < simulation.step_count(); ++i) simulation.step();
  return simulation.get<Tunnelling>().penetration();
}

// Oracle: the geometry of the start; the contact then pushes the ball out.
TEST(Penetration, IsTheDepthAtWhichAnOverlapStarts) {
  const Peak peak = deepest(ball_in_block(5e-4, "effects: [object_contact]\n"));
  EXPECT_NEAR(peak.value, 5e-4, 1e-12);
  EXPECT_NEAR(peak.time, 0, 1e-12);
  EXPECT_EQ(peak.where, "block and ball");
}

// Oracle: statics; a pad under a weight gives way by m g / k beyond the 10 um at which contacts begin to
// bear, without overshoot where it is overdamped.
TEST(Penetration, OfAPadIsItsLoadOverItsStiffness) {
  for (const char* solver : {"solver: {method: world_step}\n", "solver: {method: quick_step}\n",
                             "solver: {step: 2 ms}\n", "solver: {engine: articulated}\n"}) {
    SCOPED_TRACE(solver);
    const Peak peak =
        deepest(ball_in_block(1e-4, std::string("effects: [gravity, object_contact, friction]\n"
                                                "contacts:\n"
                                                "  materials: [{name: pad, stiffness: 3000, damping: 200}]\n"
                                                "  rules: [{between: [objects, objects], material: pad}]\n") +
                                        solver));
    EXPECT_NEAR(peak.value, 0.5 * 9.80665 / 3000 + 1e-5, 1e-7);
  }
}

TEST(Penetration, IsJudgedAndRefusedWhereNothingCanTouch) {
  const auto verdict = [](const scene::Scene& scene) {
    Simulation simulation(scene);
    for (long i = 0; i < simulation.step_count(); ++i) simulation.step();
    for (const Verdict& v : simulation.verdicts())
      if (v.name == "penetration") return v;
    return Verdict{};
  };
  const std::string limit = "criteria: {penetration: 0.4 mm}\n";
  const Verdict deep = verdict(ball_in_block(5e-4, "effects: [object_contact]\n" + limit));
  EXPECT_FALSE(deep.held());
  EXPECT_EQ(deep.where, "block and ball");
  EXPECT_TRUE(verdict(ball_in_block(3e-4, "effects: [object_contact]\n" + limit)).held());
  EXPECT_THROW(ball_in_block(5e-4, "effects: [gravity]\n" + limit), Error);
  EXPECT_EQ(verdict(ball_in_block(5e-4, "effects: [gravity]\n")).name, "");
}

}  // namespace
}  // namespace handsim::simulation
