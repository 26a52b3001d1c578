// The loop itself: its watchers, its scene, and what the caller drives.
#include "handsim/simulation/simulation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>

#include "handsim/model/kinematics.h"
#include "scene_files.h"

namespace handsim::simulation {
namespace {

using test::shipped_scene;

std::string bits(const model::State& state) {
  ArchiveWriter out;
  serialize(out, state);
  return out.take();
}

void take_steps(Simulation& simulation, int count) {
  for (int i = 0; i < count; ++i) simulation.step();
}

std::shared_ptr<const scene::Scene> shared(const std::string& name,
                                           const std::vector<std::string>& overrides = {}) {
  return std::make_shared<const scene::Scene>(shipped_scene(name, overrides));
}

const std::vector<std::string> kArticulated = {"solver.engine=articulated",
                                               "solver.method=semi_implicit_euler"};

// Oracle: bit equality with all watchers.
TEST(Watchers, DoNotChangeTheMotion) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> scenes = {
      {"dropped_hand", {"record.contacts=true"}},
      {"dropped_hand", kArticulated},
      {"pose_tracking", {}},
      {"climb_half_crimp", {"solver.step=2 ms"}},
      {"slider_crank_iftomm", {"solver={engine: dae, method: stabilised_gear, step: 0.2 ms}"}}};
  for (const auto& [name, overrides] : scenes) {
    SCOPED_TRACE(name);
    const auto scene = shared(name, overrides);
    Simulation watched(scene), bare(scene, no_watchers), some(scene, only<RunHash, Monitor>);
    for (Simulation* each : {&watched, &bare, &some}) take_steps(*each, 400);
    EXPECT_EQ(bits(bare.state()), bits(watched.state()));
    EXPECT_EQ(some.state_hash(), watched.state_hash());
    EXPECT_EQ(bare.steps(), 400);
  }
}

TEST(Watchers, AreFoundByTheirTypeOrMissed) {
  const Simulation some(shared("two_hands"), only<Monitor>);
  EXPECT_NE(some.find<Monitor>(), nullptr);
  EXPECT_EQ(some.find<Ledger>(), nullptr);
  EXPECT_THROW(static_cast<void>(some.get<Ledger>()), Error);
  EXPECT_THROW(static_cast<void>(some.state_hash()), Error);
  EXPECT_TRUE(some.figures<Tracking>().empty());
}

/// A caller's own.
class CountSteps final : public Watcher {
 public:
  explicit CountSteps(const Watched& /*watched*/) {}
  std::string_view name() const override { return "count"; }
  void update(Step& step) override {
    if (++count == 5) step.fault = PhysicsFault{step.engine.state().time, "count", "steps", "enough"};
  }
  void save(ArchiveWriter& out) const override { out(count); }
  void restore(ArchiveReader& in, const model::State& /*state*/) override { in(count); }
  long count = 0;
};

TEST(Watchers, OfTheCallerAreToldOfEachStepAndCanEndTheRun) {
  Simulation simulation(shared("two_hands"), only<CountSteps>);
  take_steps(simulation, 4);
  EXPECT_EQ(simulation.get<CountSteps>().count, 4);
  for (int i = 0; i < 2; ++i) EXPECT_THROW(simulation.step(), Error);
  EXPECT_EQ(simulation.get<CountSteps>().count, 5);
  EXPECT_THROW(simulation.snapshot(), Error);
}

// A run's snapshot serves those whose watchers are all in it.
TEST(Watchers, AreRestoredByTheirNames) {
  const auto scene = shared("dropped_hand");
  Simulation full(scene), some(scene, only<RunHash>), own(scene, only<CountSteps>);
  take_steps(full, 100);
  some.restore(full.snapshot());
  EXPECT_EQ(some.state_hash(), full.state_hash());
  const std::string before = bits(own.state());
  EXPECT_THROW(own.restore(full.snapshot()), Error);
  EXPECT_EQ(bits(own.state()), before);
  EXPECT_EQ(own.steps(), 0);
}

// Oracle: bit equality with one that stays where it was made.
TEST(Simulation, GoesOnWhereItWasMovedAndKeepsItsScene) {
  Simulation still(shipped_scene("pose_tracking"));
  take_steps(still, 200);
  std::vector<Simulation> moved;
  for (int i = 0; i < 3; ++i) moved.emplace_back(shipped_scene("pose_tracking"));
  take_steps(moved.back(), 100);
  Simulation other(shipped_scene("two_hands"));
  other = std::move(moved.back());
  moved.clear();
  const RunSnapshot snapshot = other.snapshot();
  take_steps(other, 100);
  EXPECT_EQ(other.state_hash(), still.state_hash());
  other.restore(snapshot);
  take_steps(other, 100);
  EXPECT_EQ(other.state_hash(), still.state_hash());
}

// Oracle: bit equality with the same torque as a constant of the scene.
TEST(Action, OfATorqueIsThatOfAConstantTorqueInTheScene) {
  for (const std::string solver :
       {"{engine: ode, method: world_step, step: 1 ms}", "{engine: ode, method: quick_step, step: 1 ms}",
        "{engine: dae, method: stabilised_gear, step: 1 ms}", "{engine: articulated, step: 1 ms}"}) {
    SCOPED_TRACE(solver);
    Simulation driven(shipped_scene("slider_crank_torque", {"solver=" + solver}));
    Simulation called(shipped_scene("slider_crank_torque",
                                    {"solver=" + solver, "joints.0.axes.0.torque=0", "effects=[gravity]"}));
    std::vector<double> torques(static_cast<std::size_t>(called.model().dof_count()), 0.0);
    torques[static_cast<std::size_t>(called.model().joints[0].first_dof)] = 0.1;
    for (int i = 0; i < 300; ++i) {
      driven.step();
      called.step({.torques = torques});
    }
    EXPECT_EQ(called.state_hash(), driven.state_hash());
  }
}

/// A bar on a hinge without weight: 2e-3 kg m^2 about its axis.
scene::Scene hinge(const std::string& solver) {
  scene::Scene scene = scene::compile_scene(parse_yaml(
      "{title: t, duration: 1, effects: [gravity], gravity: [0, 0, 0], bodies: [{name: bar, mass: "
      "0.1, inertia: [1e-3, 1e-3, 1e-3], position: [0.1, 0, 0]}], joints: [{name: pivot, type: hinge, "
      "parent: world, child: bar, position: [0, 0, 0], axes: [{name: swing, axis: [0, 1, 0]}]}], solver: " +
          solver + "}",
      "test.yaml"));
  scene.spec.solver.effects.add(model::Effect::actuation);
  return scene;
}

// Oracles: the recurrences of a semi-implicit step. A torque T gives w += h T / I, q += h w; a servo
// w = (I w + h k (target - q)) / (I + h c), q += h w: at the end of the step c = d + h k, on the articulated
// engine max(d, h k) (actuation.h).
// ODE's constraint force mixing (1e-12 here) and rounding leave the tolerance.
TEST(Action, MovesAHingeByTheTorqueOrServoOfTheCaller) {
  constexpr double kInertia = 2e-3, kStep = 1e-3, kTorque = 0.01, kStiffness = 0.5, kDamping = 0.02;
  constexpr double kByStep = kStep * kStiffness;
  const std::map<std::string, double> dampings = {
      {"{engine: ode, method: world_step, step: 1 ms, cfm: 1e-12}", kDamping + kByStep},
      {"{engine: articulated, step: 1 ms}", std::max(kDamping, kByStep)}};
  for (const auto& [solver, damping] : dampings) {
    SCOPED_TRACE(solver);
    Simulation simulation(hinge(solver), no_watchers);
    double q = 0, w = 0;
    const auto angle = [&] { return simulation.state().q.front(); };
    const std::vector<double> torques = {kTorque};
    for (int i = 0; i < 200; ++i) {
      simulation.step({.torques = torques});
      w += kStep * kTorque / kInertia;
      q += kStep * w;
    }
    EXPECT_NEAR(angle(), q, 1e-6 * q);
    for (int i = 0; i < 200; ++i) {
      const std::vector<model::Servo> servos = {{kStiffness, kDamping, 0.3 - angle(), 0, 10}};
      simulation.step({.servos = servos});
      w = (kInertia * w + kStep * kStiffness * (0.3 - q)) / (kInertia + kStep * damping);
      q += kStep * w;
    }
    EXPECT_NEAR(angle(), q, 1e-5 * std::abs(q));
  }
}

// Oracle: bit equality; the same servo again replaces the controller's and changes nothing, a torque adds.
TEST(Action, ReplacesTheControllersServosAndAddsToItsTorques) {
  const auto scene = shared("pose_tracking");
  Simulation alone(scene), same(scene), pushed(scene);
  const auto dofs = static_cast<std::size_t>(scene->model.dof_count());
  std::vector<double> torques(dofs, 0.0);
  std::vector<model::Servo> servos;
  torques[dofs - 1] = 1e-3;
  for (int i = 0; i < 50; ++i) {
    alone.step();
    servos.assign(alone.controller()->servos().begin(), alone.controller()->servos().end());
    same.step({.servos = servos});
    pushed.step({.torques = torques});
  }
  EXPECT_EQ(same.state_hash(), alone.state_hash());
  EXPECT_NE(pushed.state_hash(), alone.state_hash());
}

TEST(Action, OfAnotherSizeOrNotFiniteIsRefusedAndNothingMoves) {
  const auto scene = shared("pose_tracking");
  const auto dofs = static_cast<std::size_t>(scene->model.dof_count());
  Simulation simulation(scene), alone(scene);
  const auto refused = [&](const engine::StepInput& action) {
    const std::string before = bits(simulation.state());
    try {
      simulation.step(action);
    } catch (const Error& error) {
      EXPECT_EQ(bits(simulation.state()), before);
      return error.kind() == ErrorKind::input;
    }
    return false;
  };
  const std::vector<double> few(dofs - 1, 0.0);
  std::vector<double> wild(dofs, 0.0);
  wild[1] = std::numeric_limits<double>::quiet_NaN();
  const std::vector<model::Servo> many(dofs + 1);
  std::vector<model::Servo> bad(dofs), lost(dofs);
  bad[0] = {-1, 0, 0, 0, 1};
  lost[0] = {1, 0, std::numeric_limits<double>::infinity(), 0, 1};
  EXPECT_TRUE(refused({.torques = few}));
  EXPECT_TRUE(refused({.torques = wild}));
  EXPECT_TRUE(refused({.servos = many}));
  EXPECT_TRUE(refused({.servos = bad}));
  EXPECT_TRUE(refused({.servos = lost}));
  take_steps(simulation, 20);
  take_steps(alone, 20);
  EXPECT_EQ(simulation.state_hash(), alone.state_hash());
  Simulation limp(shipped_scene("two_hands"));
  const std::vector<model::Servo> right(static_cast<std::size_t>(limp.model().dof_count()));
  try {
    limp.step({.servos = right});
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("actuation"), std::string::npos) << error.what();
  }
}

// Oracle: bit equality with a new simulation, after steps and after the fault of a watcher.
TEST(Reset, ToTheStartHasTheBitsOfANewSimulation) {
  for (const char* name : {"dropped_hand", "pose_tracking"}) {
    Simulation again(shared(name)), first(shared(name));
    take_steps(again, 150);
    again.reset();
    EXPECT_EQ(bits(again.state()), bits(first.state())) << name;
    take_steps(again, 100);
    take_steps(first, 100);
    EXPECT_EQ(again.state_hash(), first.state_hash()) << name;
  }
  Simulation ended(shared("two_hands"), only<CountSteps>), first(shared("two_hands"));
  const MotionSnapshot motion = ended.motion();
  const RunSnapshot snapshot = ended.snapshot();
  const std::vector<std::function<void()>> ways = {[&] { ended.reset(); }, [&] { ended.reset(motion); },
                                                   [&] { ended.restore(snapshot); }};
  for (const auto& back : ways) {
    take_steps(ended, 4);
    EXPECT_THROW(ended.step(), Error);
    back();
    EXPECT_EQ(bits(ended.state()), bits(first.state()));
    EXPECT_EQ(ended.get<CountSteps>().count, 0);
    EXPECT_EQ(ended.steps(), 0);
  }
}

TEST(Reset, TakesTheMotionsOfItsOwnSceneAloneAndStartsWatchersAnew) {
  const auto scene = shared("pose_tracking");
  Simulation first(scene), second(*scene), other(shipped_scene("pose_tracking"));
  take_steps(first, 700);
  const MotionSnapshot motion = first.motion();
  EXPECT_THROW(other.reset(motion), Error);
  EXPECT_EQ(other.steps(), 0);
  second.reset(motion);
  EXPECT_EQ(second.steps(), 700);
  EXPECT_EQ(bits(second.state()), bits(first.state()));
  EXPECT_EQ(second.get<Monitor>().joint_gap().value, 0);
  // Of a movement that was under way at the reset nothing is measured.
  for (const AxisTracking& axis : second.figures<Tracking>()) EXPECT_EQ(axis.holds, 0);
  for (int i = 0; i < 300; ++i) {
    first.step();
    second.step();
  }
  EXPECT_EQ(bits(second.state()), bits(first.state()));
}

}  // namespace
}  // namespace handsim::simulation
