// MuJoCo behind handsim's interface, as the hard cases run it. Oracle: the articulated engine on the same
// model.
#include "peers/mujoco_engine.h"

#include <gtest/gtest.h>

#include "handsim/model/kinematics.h"
#include "scene_files.h"

namespace handsim::peers {
namespace {

double farthest(const model::State& a, const model::State& b) {
  double out = 0;
  for (std::size_t i = 0; i < a.bodies.size(); ++i)
    out = std::max(out, (a.bodies[i].p - b.bodies[i].p).norm());
  return out;
}

scene::Scene swinging_hand(const std::string& method, const std::string& effects) {
  return test::shipped_scene("stability/swinging_hand",
                             {"solver.engine=articulated", "solver.method=" + method,
                              "hands.0.wrist.mount=universal", "effects=" + effects});
}

TEST(MujocoEngine, FollowsOursAndTakesItsStates) {
  const scene::Scene scene = swinging_hand("rk4", "[gravity, passive_tissue]");
  const auto ours = engine::make_engine(scene.model, scene.spec.solver);
  MujocoOptions options;
  options.integrator = "RK4";
  const auto theirs = make_mujoco(scene.model, scene.spec.solver, options);
  for (int i = 0; i < 100; ++i) {
    ours->step({});
    theirs->step({});
  }
  EXPECT_GT(farthest(ours->state(), model::initial_state(scene.model)), 1e-2);
  EXPECT_LT(farthest(ours->state(), theirs->state()), 1e-7);
  const auto third = make_mujoco(scene.model, scene.spec.solver, options);
  third->set_state(ours->state());
  for (int i = 0; i < 50; ++i) {
    ours->step({});
    third->step({});
  }
  EXPECT_LT(farthest(ours->state(), third->state()), 1e-7);
}

TEST(MujocoEngine, HasTheSameServos) {
  scene::Scene scene = swinging_hand("semi_implicit_euler", "[]");
  scene.spec.solver.effects.add(model::Effect::actuation);
  const auto ours = engine::make_engine(scene.model, scene.spec.solver);
  const auto theirs = make_mujoco(scene.model, scene.spec.solver, {});
  std::vector<model::Servo> servos(static_cast<std::size_t>(scene.model.dof_count()));
  for (const auto& engine : {ours.get(), theirs.get()})
    for (int i = 0; i < 100; ++i) {
      for (std::size_t k = 0; k < servos.size(); ++k)
        servos[k] = {1e-3, 1e-5, 0.5 - engine->state().q[k], 0, 1};
      engine->step({.servos = servos});
    }
  EXPECT_GT(farthest(ours->state(), model::initial_state(scene.model)), 1e-3);
  // Theirs has damper and step together damp as ours, in its own integrator.
  EXPECT_LT(farthest(ours->state(), theirs->state()), 1e-4);
}

TEST(MujocoEngine, RefusesWhatItCannotSay) {
  const scene::Scene bouncing =
      test::shipped_scene("stability/bouncing_balls", {"solver.engine=articulated"});
  EXPECT_THROW(make_mujoco(bouncing.model, bouncing.spec.solver, {}), Error);
}

}  // namespace
}  // namespace handsim::peers
