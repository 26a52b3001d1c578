// The slider-crank whose block slides on a floor; the motion is comparable until the block lifts off.
#include <gtest/gtest.h>

#include <cmath>

#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::study {
namespace {

constexpr std::size_t kBlock = 2;

/// Positions of the block every 10 ms [m].
std::vector<Vec3> block(double step, double duration) {
  const scene::Scene scene =
      test::shipped_scene("slider_crank_contact",
                          {"solver.step=" + std::to_string(step), "duration=" + std::to_string(duration)});
  EXPECT_EQ(scene.model.bodies[kBlock].name, "slider");
  simulation::Simulation simulation(scene);
  std::vector<Vec3> out;
  const long stride = std::lround(0.01 / step);
  for (long i = 1; i <= simulation.step_count(); ++i) {
    simulation.step();
    if (i % stride == 0) out.push_back(simulation.state().bodies[kBlock].p);
  }
  return out;
}

double largest_difference(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double out = 0;
  for (std::size_t i = 0; i < a.size(); ++i) out = std::max(out, (a[i] - b[i]).norm());
  return out;
}

// Oracle: order of convergence 1, with the smallest step as reference.
TEST(ContactSliderCrank, ConvergesAtFirstOrderWhileTheBlockLiesOnTheFloor) {
  const std::vector<Vec3> fine = block(2e-5, 0.25);
  for (const Vec3& place : fine) EXPECT_LT(place.z(), 1e-5);
  const double coarse_error = largest_difference(block(2e-3, 0.25), fine);
  const double fine_error = largest_difference(block(2e-4, 0.25), fine);
  EXPECT_LT(fine_error, 5e-5);
  EXPECT_NEAR(std::log10(coarse_error / fine_error), 1, 0.3);
}

// Oracle: the rod's upward force, which exceeds the weight once a revolution. There the comparison ends.
TEST(ContactSliderCrank, LiftsTheBlockOffTheFloorAfterwards) {
  double highest = 0;
  for (const Vec3& place : block(1e-4, 0.6)) highest = std::max(highest, place.z());
  EXPECT_GT(highest, 1e-3);
}

}  // namespace
}  // namespace handsim::study
