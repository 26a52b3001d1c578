#include "handsim/simulation/watch/convergence.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::simulation {
namespace {

using test::shipped_scene;
using test::TemporaryFolder;

struct Residuals {
  double linear = 0, angular = 0, contact = 0;
};

Residuals residuals(const std::string& scene_name, int iterations,
                    const std::vector<std::string>& more = {}) {
  std::vector<std::string> overrides = {"solver.method=quick_step",
                                        "solver.iterations=" + std::to_string(iterations)};
  overrides.insert(overrides.end(), more.begin(), more.end());
  const scene::Scene scene = shipped_scene(scene_name, overrides);
  Simulation simulation(scene);
  for (int i = 0; i < 150; ++i) simulation.step();
  const Convergence& found = simulation.get<Convergence>();
  // All steps with contact; of those without every eighth, and where stops come and go.
  EXPECT_GE(found.measured(), simulation.get<Ledger>().contacts() > 0 ? 150 : 19);
  EXPECT_LE(found.measured(), 150);
  return {found.linear().value, found.angular().value, found.contact().value};
}

// Oracle: an iteration that goes on long enough solves its equations; a residual that left out any term of
// them would stay at that term. Every kind of joint is in the two scenes.
TEST(Residual, OfQuickStepGoesToNothingWithItsIterations) {
  for (const char* scene : {"two_hands", "slider_crank_iftomm"}) {
    const Residuals few = residuals(scene, 5), many = residuals(scene, 100), most = residuals(scene, 2000);
    EXPECT_GT(few.linear, 10 * most.linear) << scene;
    EXPECT_GT(few.linear, many.linear) << scene;
    EXPECT_LT(most.linear, 1e-5) << scene;
    EXPECT_LT(most.angular, 1e-3) << scene;
    EXPECT_GT(few.angular, 10 * most.angular) << scene;
  }
}

// A tower of rigid boxes, which a few iterations let sink into each other.
TEST(Residual, OfRigidContactsIsTheSpeedAtWhichTheyStillComeCloser) {
  const auto tower = [](int iterations) {
    return residuals(
        "dropped_hand", iterations,
        {"hands=[]",
         "objects=[{name: a, shape: box, edges: [0.1, 0.1, 0.1], mass: 1, position: [0, 0, 0.05]}, "
         "{name: b, shape: box, edges: [0.1, 0.1, 0.1], mass: 20, position: [0, 0, 0.15]}]",
         "effects=[gravity, object_contact, ground_contact, friction]", "criteria={}"});
  };
  const Residuals few = tower(2), most = tower(2000);
  EXPECT_GT(few.contact, 1e-2);
  EXPECT_LT(most.contact, 1e-4);
}

TEST(Residual, IsToldInTheSummaryWithAWarningWhereItIsBad) {
  const TemporaryFolder folder;
  const auto run_with = [&](const std::string& method) {
    RunOptions options;
    options.out = folder.path() / method;
    return run(shipped_scene("two_hands", {"solver.method=" + method, "solver.iterations=2", "duration=0.2"}),
               options);
  };
  const RunResult bad = run_with("quick_step"), good = run_with("world_step");
  ASSERT_FALSE(bad.warnings.empty());
  EXPECT_NE(bad.warnings[0].find("coming apart"), std::string::npos) << bad.warnings[0];
  EXPECT_TRUE(good.warnings.empty()) << good.warnings[0];
  const auto json = nlohmann::json::parse(bad.summary)["convergence"];
  EXPECT_GE(json["steps_measured"], 25);
  EXPECT_LT(json["steps_measured"], 200);
  EXPECT_GT(json["joint_residual_m_per_s"]["largest"], 0.01);
  EXPECT_EQ(json["warnings"].size(), bad.warnings.size());
  EXPECT_EQ(nlohmann::json::parse(good.summary)["convergence"]["steps_measured"], 0);
}

// Nothing pulls the joints back together: their drift has to end the run, with the joint's name.
TEST(Divergence, OfAJointThatComesApartIsAFault) {
  const TemporaryFolder folder;
  RunOptions options;
  options.out = folder.path();
  const RunResult result =
      run(shipped_scene("slider_crank_iftomm", {"solver.erp=0", "solver.step=0.02", "duration=60"}), options);
  ASSERT_TRUE(result.fault);
  EXPECT_EQ(result.fault->quantity, "joint gap [m]");
  EXPECT_FALSE(result.fault->where.empty());
  EXPECT_LT(result.fault->time, 60);
  EXPECT_NEAR(result.simulated, result.fault->time, 1e-9);
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "summary.json"));
}

}  // namespace
}  // namespace handsim::simulation
