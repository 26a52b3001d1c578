// The `solver` block: each engine's own keys, a switch of engines on the command line, and which engine runs
// which shipped scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>

#include "handsim/engine/engine.h"
#include "handsim/scene/read/blocks.h"
#include "scene_files.h"
#include "support/sanitized.h"

namespace handsim::scene {
namespace {

using model::Effect;

Scene ball(const std::string& rest) {
  return compile_scene(parse_yaml(
      "objects: [{name: ball, shape: sphere, radius: 0.1, mass: 1, position: [0, 0, 0]}]\nduration: 1\n" +
          rest,
      "ball.yaml"));
}

template <class Make>
std::string refusal(Make make) {
  try {
    make();
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

std::string refusal_of(const std::string& rest) {
  return refusal([&] { ball(rest); });
}

// Oracle: the contract: place, key, and the engine that has it.
TEST(SolverKeys, OfAnotherEngineAreRefusedWithTheEngineThatHasThem) {
  EXPECT_EQ(refusal_of("solver: {engine: dae, cfm: 1e-8}\neffects: []\n"),
            "ball.yaml:3:28: solver.cfm: got 1e-8, need a key of engine dae: cfm is one of engine ode");
  EXPECT_NE(refusal_of("solver: {tolerance: 1e-8}\n").find("is one of engine dae and articulated"),
            std::string::npos);
  EXPECT_NE(refusal_of("solver: {accuracy: 0.1}\n").find("is one of engine auto"), std::string::npos);
  EXPECT_NE(refusal_of("solver: {stepp: 0.1}\n").find("an unknown key"), std::string::npos);
}

// Oracle: the contract of a switch: the engine's default method; settings common to both engines stay.
TEST(EngineSwitch, IgnoresTheFilesSettingsOfItsOwnEngine) {
  const Scene scene = test::shipped_scene("grasp_pinch", {"solver.engine=articulated"});
  const engine::Settings& solver = scene.spec.solver;
  EXPECT_EQ(solver.method(), engine::ArticulatedMethod::semi_implicit_euler);
  EXPECT_EQ(solver.step, 1e-3);
  const auto warns = [&](const std::string& text) {
    return std::any_of(scene.warnings.begin(), scene.warnings.end(),
                       [&](const std::string& warning) { return warning.find(text) != std::string::npos; });
  };
  EXPECT_TRUE(
      warns("the file's method world_step, cfm, seed left out: engine articulated does not have them"));
  // What was left out is not in the resolved scene, which repeats the run.
  EXPECT_EQ(scene.resolved.find("solver")->find("cfm"), nullptr);
  EXPECT_EQ(compile_scene(scene.resolved).spec.solver.method(), solver.method());
}

// Oracle: the contract: settings given on the command line with the engine are not ignored.
TEST(EngineSwitch, RefusesKeysThatTheCommandLineAddsForAnotherEngine) {
  const auto switched = [](const std::string& set) {
    return refusal([&] { test::shipped_scene("two_hands", {"solver.engine=articulated", set}); });
  };
  EXPECT_NE(switched("solver.cfm=1e-7").find("cfm is one of engine ode"), std::string::npos);
  EXPECT_NE(switched("solver.method=quick_step").find("need one of semi_implicit_euler"), std::string::npos);
  EXPECT_EQ(switched("solver.method=semi_implicit_euler"), "accepted");
}

std::vector<std::filesystem::path> shipped() {
  std::vector<std::filesystem::path> out;
  for (const char* folder : {"config", "config/stability"})
    for (const auto& entry : std::filesystem::directory_iterator(test::source(folder)))
      if (entry.path().extension() == ".yaml" && kind_of(load_yaml(entry.path())) == FileKind::scene)
        out.push_back(entry.path());
  std::sort(out.begin(), out.end());
  return out;
}

// Oracle: the engines' contracts: ode and articulated run every shipped scene; dae runs smooth motion,
// without contact, stops and servos. The table is printed.
TEST(EngineSwitch, RunsEveryShippedSceneThatTheEngineCanRun) {
  HANDSIM_SKIP_WITH_SANITIZER("another test steps every shipped scene");
  const std::vector<std::filesystem::path> scenes = shipped();
  ASSERT_GT(scenes.size(), 60U);
  for (const std::filesystem::path& path : scenes) {
    const Scene whole = load_scene(path);
    const model::Effects& effects = whole.spec.solver.effects;
    for (const std::string engine : {"ode", "dae", "articulated"}) {
      const std::string why = refusal([&] {
        const Scene scene = load_scene(path, {"solver.engine=" + engine});
        engine::make_engine(scene.model, scene.spec.solver);
      });
      std::cout << path.filename().string() << '\t' << engine << '\t' << (why == "accepted" ? "runs" : why)
                << '\n';
      if (engine != "dae" || why == "accepted") {
        EXPECT_EQ(why, "accepted") << path << ' ' << engine;
      } else if (effects.any_contact() || effects.has(Effect::joint_stops)) {
        EXPECT_NE(why.find("effects: got "), std::string::npos) << path << ": " << why;
      } else {
        EXPECT_NE(why.find("control.controller.form"), std::string::npos) << path << ": " << why;
      }
      if (engine == "dae" && (effects.any_contact() || effects.has(Effect::joint_stops))) {
        EXPECT_NE(why, "accepted") << path;
      }
    }
  }
}

// Oracle: the contract: engine auto with nothing but its name takes the default accuracy of 1 %.
TEST(EngineSwitch, ToAutoChoosesForOnePerCent) {
  const Scene scene = test::shipped_scene("slider_crank_iftomm", {"solver.engine=auto"});
  EXPECT_NE(scene.spec.engine_choice.find("reaches 0.01"), std::string::npos) << scene.spec.engine_choice;
}

}  // namespace
}  // namespace handsim::scene
