// Engine `auto`: its choice from the table of costs, and the resulting scene.
#include "handsim/scene/read/engine_choice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "scene_files.h"

namespace handsim::scene {
namespace {

std::vector<CostTable> shipped_costs() {
  YamlNode root = load_yaml(test::source("config/accuracy_costs.yaml"));
  Diagnostics diagnostics;
  std::vector<CostTable> out = read_costs(root, "", diagnostics);
  EXPECT_TRUE(diagnostics.problems.empty());
  return out;
}

Scene chosen(const std::string& name, double accuracy, std::vector<std::string> more = {},
             const std::string& keys = "") {
  std::ostringstream text;
  text << "solver={engine: auto, accuracy: " << accuracy << (keys.empty() ? "" : ", ") << keys << "}";
  more.push_back(text.str());
  more.emplace_back("criteria={}");
  return test::shipped_scene(name, more);
}

const std::string kFree = "effects=[gravity, passive_tissue]";

// Oracle: the table itself, searched by this test.
TEST(EngineChoice, IsTheCheapestRowThatReachesTheAccuracy) {
  const std::vector<CostTable> costs = shipped_costs();
  ASSERT_EQ(costs.size(), kSceneKindNames.size());
  struct Case {
    SceneKind kind;
    std::string scene;
    std::vector<std::string> more;
  };
  const std::vector<Case> cases = {
      {SceneKind::tree, "two_hands", {kFree, "duration=0.2"}},
      {SceneKind::loop, "slider_crank_iftomm", {}},
      {SceneKind::stops, "two_hands", {"duration=0.5"}},
      {SceneKind::contact,
       "dropped_hand",
       {"duration=1", "effects=[gravity, ground_contact, friction, joint_stops]"}}};
  for (const Case& c : cases)
    for (const double accuracy : {0.3, 0.1, 0.01}) {
      const CostTable& table = costs[static_cast<std::size_t>(c.kind)];
      ASSERT_EQ(table.kind, c.kind);
      const CostRow* expected = nullptr;
      for (const CostRow& row : table.rows)
        if (row.error <= accuracy && (!expected || row.cost < expected->cost)) expected = &row;
      ASSERT_NE(expected, nullptr);
      const Scene scene = chosen(c.scene, accuracy, c.more);
      EXPECT_EQ(scene.spec.solver.method(), expected->solver.method()) << c.scene << ' ' << accuracy;
      EXPECT_EQ(scene.spec.solver.step, expected->solver.step);
      EXPECT_NE(scene.spec.engine_choice.find(engine::name(expected->solver.method())), std::string::npos);
      for (const std::string& warning : scene.warnings)
        EXPECT_EQ(warning.find("engine auto"), std::string::npos) << warning;
    }
}

// Oracle: the definition: the scene's duration is the end of the climb.
TEST(EngineChoice, WarnsOfClimbsThatTakeLongerThanWasMeasured) {
  const Scene scene = chosen("climb_half_crimp", 0.3);
  EXPECT_GT(scene.spec.duration, 20);
  EXPECT_TRUE(std::any_of(scene.warnings.begin(), scene.warnings.end(), [](const std::string& warning) {
    return warning.find("errors were measured over") != std::string::npos;
  }));
}

// Oracle: the purpose of the resolved scene: the same run, even if the table changes.
TEST(EngineChoice, IsWrittenIntoTheResolvedScene) {
  const Scene scene = chosen("two_hands", 1e-8, {kFree, "duration=0.2"});
  EXPECT_EQ(scene.spec.solver.method(), engine::ArticulatedMethod::dormand_prince);
  const YamlNode* solver = scene.resolved.find("solver");
  ASSERT_NE(solver, nullptr);
  EXPECT_EQ(solver->find("engine")->text, "articulated");
  EXPECT_EQ(solver->find("accuracy"), nullptr);
  EXPECT_EQ(solver->find("costs"), nullptr);
  const Scene again = compile_scene(scene.resolved);
  EXPECT_EQ(again.spec.solver.method(), scene.spec.solver.method());
  EXPECT_EQ(again.spec.solver.step, scene.spec.solver.step);
  EXPECT_EQ(again.spec.solver.articulated().tolerance, scene.spec.solver.articulated().tolerance);
}

// Oracle: the definition.
TEST(EngineChoice, WarnsOfScenesOutsideTheMeasurements) {
  const Scene scene = chosen("two_hands", 0.01, {kFree, "duration=2"});
  ASSERT_EQ(scene.warnings.size(), 1U);
  EXPECT_NE(scene.warnings.front().find("the scene lasts 2 s"), std::string::npos);
  EXPECT_FALSE(chosen("slider_crank_contact", 0.1, {"duration=1"}).warnings.empty());
}

// Oracle: the default settings.
TEST(EngineChoice, IsOnlyMadeOnRequest) {
  const Scene scene = test::shipped_scene("two_hands");
  EXPECT_EQ(scene.spec.solver.method(), engine::OdeMethod::world_step);
  EXPECT_TRUE(scene.spec.engine_choice.empty());
}

}  // namespace
}  // namespace handsim::scene
