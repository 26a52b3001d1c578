// Shipped grasps, exported in the midst of their hold and loaded in MuJoCo as they are.
#include <gtest/gtest.h>

#include <cstdio>

#include "handsim/simulation/simulation.h"
#include "peers/mujoco_model.h"
#include "scene_files.h"
#include "support/written.h"

namespace handsim::test {
namespace {

using ExportedGrasps = testing::TestWithParam<const char*>;

// Oracle: the grasp holds its object here. Bound: 2 mm in 1 s, less than a pad's depth; with a damper that
// acts at the step's start the ball moves 465 mm.
TEST_P(ExportedGrasps, StayInTheHand) {
  const scene::Scene scene = shipped_scene(
      std::string("grasp_") + GetParam(), {"solver.engine=articulated", "solver.method=semi_implicit_euler"});
  simulation::Simulation run(scene, simulation::no_watchers);
  const scene::GraspPlan& grasp = scene.plans.grasps.front();
  while (run.state().time < grasp.phase("hold")->start + 1) run.step();
  const output::Moment moment = output::moment_after(run.state(), run.controller());
  const auto model =
      mujoco::compile(test::written("mjcf", scene.model, scene.spec.solver, &*scene.control, &moment));
  const std::unique_ptr<mjData, mujoco::Free> data(mj_makeData(model.get()));
  mj_resetDataKeyframe(model.get(), data.get(), 0);
  const int body = mj_name2id(model.get(), mjOBJ_BODY, grasp.object.c_str());
  ASSERT_GE(body, 0);
  const Eigen::Map<const Vec3> place(data->xpos + 3 * body);
  mj_kinematics(model.get(), data.get());
  const Vec3 start = place;
  double farthest = 0;
  while (data->time < 1) {
    mj_step(model.get(), data.get());
    farthest = std::max(farthest, (place - start).norm());
  }
  std::printf("grasp_%s in MuJoCo %s: %d contacts, at most %.3f mm from its start in 1 s\n", GetParam(),
              mj_versionString(), data->ncon, 1e3 * farthest);
  EXPECT_LT(farthest, 2e-3);
}

INSTANTIATE_TEST_SUITE_P(Shipped, ExportedGrasps,
                         testing::Values("tripod", "pinch", "cup", "cylinder_50mm", "cylinder_100mm",
                                         "power_can", "sphere_35mm", "sphere_70mm", "hook_bar",
                                         "cracker_box"),
                         [](const auto& each) { return std::string(each.param); });

}  // namespace
}  // namespace handsim::test
