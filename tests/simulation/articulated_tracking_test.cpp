// A hand driven through poses: the articulated engine and ODE under the same controller.
#include <gtest/gtest.h>

#include <cmath>

#include "handsim/model/kinematics.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::simulation {
namespace {

/// Joint coordinates of both hands on their swinging wrists, on their way to the second pose.
std::vector<double> tracked(const std::string& engine, const std::string& method, const std::string& step) {
  const scene::Scene scene =
      test::shipped_scene("pose_tracking", {"solver.engine=" + engine, "solver.method=" + method,
                                            "solver.step=" + step, "duration=1.5", "solver.erp=0.8"});
  Simulation simulation(scene);
  for (long i = 0; i < simulation.step_count(); ++i) simulation.step();
  return simulation.state().q;
}

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  double out = 0;
  for (std::size_t i = 0; i < a.size(); ++i) out = std::max(out, std::abs(a[i] - b[i]));
  return out;
}

// Oracle: another engine. Both are of first order, and so is their distance.
TEST(ArticulatedTracking, GoesWhereOdeGoesAsTheStepShrinks) {
  const auto apart = [&](const std::string& step) {
    return distance(tracked("articulated", "semi_implicit_euler", step), tracked("ode", "world_step", step));
  };
  const double coarse = apart("2 ms"), fine = apart("0.25 ms");
  EXPECT_LT(coarse, 5e-3);
  EXPECT_LT(fine, 0.25 * coarse);
}

// Oracle: its own motion at 1 ms. The same targets are held at 20 ms, where explicit gains would have
// exploded.
TEST(ArticulatedTracking, HoldsAPoseAtTwentyMilliseconds) {
  const std::vector<double> fine = tracked("articulated", "semi_implicit_euler", "1 ms");
  EXPECT_LT(distance(tracked("articulated", "semi_implicit_euler", "20 ms"), fine), 0.05);
}

}  // namespace
}  // namespace handsim::simulation
