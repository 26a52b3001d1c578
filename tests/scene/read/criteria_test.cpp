// Criteria on figures that a scene does not measure are refused. Oracle: the content of the scene.
#include "handsim/scene/read/scene_file.h"

#include <gtest/gtest.h>

#include "scene_files.h"

namespace handsim::scene {
namespace {

using test::shipped_scene;

/// The error message of a shipped scene with changes; empty if it compiles.
std::string refused(const std::string& name, const std::vector<std::string>& changes) {
  try {
    shipped_scene(name, changes);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(Criteria, OfStopsNeedTheEffectJointStops) {
  const std::string text = refused("two_hands", {"effects=[gravity]"});
  EXPECT_TRUE(contains(text, "criteria.stop_overshoot: got a limit without the effect joint_stops")) << text;
  EXPECT_TRUE(contains(text, "criteria.stop_rest: got a limit without the effect joint_stops")) << text;
  EXPECT_EQ(refused("two_hands", {"effects=[gravity]", "criteria={joint_gap: 1 mm, lcp_failures: 0}"}), "");
}

TEST(Criteria, OfPosesAndMovementsNeedAProgramThatHasThem) {
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "wave.csv";
  std::ofstream(file) << "time,index_mcp.flexion[deg]\n0,10\n1,20\n";
  const std::string one =
      "control.controller.gains=[{joints: index_mcp.flexion, frequency: 8 Hz, damping_ratio: 1, "
      "torque_limit: 1}]";
  const std::string program = "control.program=" + file.string();
  const std::string text = refused("every_pose", {program, one});
  for (const char* key : {"steady_error", "overshoot", "settling_time"})
    EXPECT_TRUE(contains(text, std::string("criteria.") + key + ": got a limit with a motion file")) << text;
  EXPECT_EQ(refused("every_pose", {program, one, "criteria={rms_error: 1, largest_error: 1}"}), "");
  const std::string still = refused(
      "every_pose",
      {"control.poses.programs.every_pose={keys: [{time: 0, pose: fist}, {time: 1, move: 0.5, pose: fist}]}",
       "hands.0.pose={}", "hands.1.pose={}", one, "criteria={steady_error: 1, overshoot: 1}"});
  EXPECT_TRUE(still.empty() ||
              contains(still, "criteria.overshoot: got a limit with a program that moves no joint"))
      << still;
}

TEST(Criteria, OfAClimbMustNotExceedItsLoad) {
  EXPECT_TRUE(contains(refused("climb_jug", {"criteria.climb_load=1001 N"}),
                       "criteria.climb_load: got 1001 N of a climb whose load ends at 1000 N"));
  EXPECT_EQ(refused("climb_jug", {"criteria.climb_load=1000 N"}), "");
}

TEST(Criteria, OfTheSolverAreAllowedInAnyScene) {
  EXPECT_EQ(
      refused("slider_crank_iftomm", {"solver={engine: dae}", "criteria={lcp_failures: 0, joint_gap: 1}"}),
      "");
}

}  // namespace
}  // namespace handsim::scene
