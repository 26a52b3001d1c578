// Criteria whose figure the run did not come to. Oracle: the README: not measured is not held.
#include <gtest/gtest.h>

#include <map>

#include <nlohmann/json.hpp>

#include "handsim/simulation/run/run.h"
#include "scene_files.h"

namespace handsim::simulation {
namespace {

using test::shipped_scene;
using test::TemporaryFolder;

struct Ran {
  RunResult result;
  std::map<std::string, Verdict> verdicts;
  nlohmann::json summary;

  std::string word(const std::string& name) const {
    for (const auto& entry : summary["criteria"])
      if (entry["name"] == name) return entry["verdict"];
    return "no such criterion";
  }
};

Ran ran(const scene::Scene& scene) {
  const TemporaryFolder folder;
  RunOptions options;
  options.out = folder.path();
  Ran out{run(scene, options), {}, {}};
  for (const Verdict& verdict : out.result.verdicts) out.verdicts[verdict.name] = verdict;
  out.summary = nlohmann::json::parse(out.result.summary);
  return out;
}

std::string seconds(double time) { return "duration=" + std::to_string(time); }

TEST(GraspCutShort, BeforeItsHoldIsMeasuredInNothingAndDoesNotPass) {
  const Ran cut = ran(shipped_scene("grasp_pinch", {"duration=0.1", "criteria={grasp_slip: 0}"}));
  for (const char* name : {"grasp_shaken", "grasp_shift", "grasp_turn", "grasp_others", "grasp_slip"}) {
    EXPECT_EQ(cut.word(name), "not measured") << name;
    EXPECT_TRUE(cut.verdicts.at(name).limit.has_value()) << name;
    EXPECT_FALSE(cut.verdicts.at(name).measured.has_value()) << name;
  }
  EXPECT_FALSE(cut.result.passed());
  EXPECT_EQ(cut.summary["verdict"], "not measured");
}

TEST(GraspCutShort, AfterItsHoldIsJudgedByItsSlip) {
  const std::vector<std::string> quick = {"grasps.0.hold=0.05 s", "grasps.0.close=0.1 s",
                                          "grasps.0.lift.time=0.1 s", "grasps.0.approach.time=0.1 s",
                                          "criteria={grasp_slip: 0}"};
  const double end = shipped_scene("grasp_pinch", quick).plans.grasps[0].phase("hold")->end;
  std::vector<std::string> words = quick;
  words.push_back(seconds(end + 0.01));
  const Ran cut = ran(shipped_scene("grasp_pinch", words));
  EXPECT_EQ(cut.word("grasp_slip"), "failed");
  EXPECT_EQ(cut.word("grasp_shift"), "not measured");
  EXPECT_EQ(cut.summary["verdict"], "failed");
}

TEST(ClimbCutShort, BeforeItsLoadIsNotMeasured) {
  const Ran cut = ran(shipped_scene("climb_jug", {"duration=0.1", "criteria={climb_load: 0}"}));
  EXPECT_EQ(cut.word("climb_load"), "not measured");
  EXPECT_FALSE(cut.result.passed());
}

// The load grows by 50 N/s from the end of the settling on.
TEST(ClimbCutShort, HasCarriedWhatItHasAndIsUnknownBeyond) {
  const double start = shipped_scene("climb_jug").plans.climbs[0].loading().start;
  const Ran enough = ran(shipped_scene("climb_jug", {seconds(start + 0.3), "criteria={climb_load: 10 N}"}));
  EXPECT_EQ(enough.word("climb_load"), "held");
  const Ran more = ran(shipped_scene("climb_jug", {seconds(start + 0.3), "criteria={climb_load: 20 N}"}));
  EXPECT_EQ(more.word("climb_load"), "not measured");
  EXPECT_FALSE(more.result.passed());
}

TEST(ProgramCutShort, BeforeItsFirstMovementHasNoOvershoot) {
  const Ran cut = ran(shipped_scene("every_pose", {"duration=0.1"}));
  EXPECT_EQ(cut.word("overshoot"), "not measured");
  EXPECT_EQ(cut.word("settling_time"), "not measured");
  EXPECT_EQ(cut.word("largest_error"), "not judged");
  EXPECT_FALSE(cut.result.passed());
  EXPECT_EQ(cut.summary["verdict"], "not measured");
}

TEST(ASceneWithoutJoints, HasNoGapAndNoStop) {
  const Ran ball =
      ran(scene::compile_scene(parse_yaml("objects: [{name: b, shape: sphere, radius: 0.1, mass: 1, "
                                          "position: [0, 0, 1]}]\neffects: [gravity]\nduration: "
                                          "0.01\n",
                                          "ball.yaml")));
  for (const char* name : {"joint_gap", "stop_overshoot", "stop_rest"})
    EXPECT_FALSE(ball.verdicts.at(name).measured.has_value()) << name;
  EXPECT_TRUE(ball.result.passed());
  EXPECT_EQ(ball.summary["verdict"], "not judged");
}

}  // namespace
}  // namespace handsim::simulation
