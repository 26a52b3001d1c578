// resolved.yaml stands alone: it repeats its run to the bit, from another folder and without the files that
// the scene was made of. Oracle: bit equality of states (state_hash) and of the resolved text itself.
#include <gtest/gtest.h>

#include "handsim/scene/read/blocks.h"
#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"
#include "handsim/study/grasp/grasp_study.h"
#include "scene_files.h"
#include "simulation/random_scenes.h"

namespace handsim::simulation {
namespace {

using test::shipped_scene;
using test::source;
using test::TemporaryFolder;
using test::text_of;
namespace fs = std::filesystem;

fs::path write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
  return path;
}

RunResult run_in(const scene::Scene& scene, const fs::path& out) {
  RunOptions options;
  options.out = out;
  return run(scene, options);
}

/// Runs the scene, moves what it left, and runs that again.
void expect_repeated(const scene::Scene& scene, const TemporaryFolder& folder) {
  const RunResult first = run_in(scene, folder.path() / "first");
  const fs::path moved = folder.path() / "else" / "where";
  fs::create_directories(moved.parent_path());
  fs::rename(folder.path() / "first", moved);
  const RunResult again = run_in(scene::load_scene(moved / "resolved.yaml"), folder.path() / "again");
  EXPECT_EQ(hash_text(again.state_hash), hash_text(first.state_hash));
  EXPECT_EQ(text_of(folder.path() / "again" / "resolved.yaml"), text_of(moved / "resolved.yaml"));
}

std::vector<fs::path> shipped_scenes() {
  std::vector<fs::path> out;
  for (const char* folder : {"config", "config/stability"})
    for (const auto& file : fs::directory_iterator(source(folder)))
      if (file.path().extension() == ".yaml" &&
          scene::kind_of(load_yaml(file.path())) == scene::FileKind::scene)
        out.push_back(file.path());
  std::sort(out.begin(), out.end());
  return out;
}

class ShippedScene : public testing::TestWithParam<fs::path> {};

TEST_P(ShippedScene, RunsAgainFromItsResolvedFileToTheBit) {
  const TemporaryFolder folder;
  expect_repeated(scene::load_scene(GetParam(), {"duration=0.05"}), folder);
}

INSTANTIATE_TEST_SUITE_P(All, ShippedScene, testing::ValuesIn(shipped_scenes()), [](const auto& test) {
  std::string name = test.param.parent_path().filename().string() + "_" + test.param.stem().string();
  std::replace_if(
      name.begin(), name.end(), [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; }, '_');
  return name;
});

/// Hash of the first steps, and the fault that ends them.
std::string course_of(const scene::Scene& scene) {
  constexpr long kSteps = 40;
  Simulation simulation(scene);
  try {
    for (long i = 0; i < std::min(kSteps, simulation.step_count()); ++i) simulation.step();
  } catch (const Error& error) {
    return error.what();
  }
  return hash_text(simulation.state_hash());
}

TEST(RandomScenes, RunAgainFromTheirResolvedTextToTheBit) {
  test::drawn::fix_seed();
  int repeated = 0;
  const bool held = rc::check("repeats to the bit", [&] {
    const test::drawn::Drawn drawn = test::drawn::random_scene();
    if (drawn.refused) return;
    RC_LOG() << drawn.text;
    try {
      const scene::Scene scene =
          scene::compile_scene(parse_yaml(drawn.text, source("config/drawn.yaml").string()));
      const std::string text = scene::standalone_text(scene.resolved, scene.inputs);
      const scene::Scene again = scene::compile_scene(parse_yaml(text, "/nowhere/resolved.yaml"));
      RC_ASSERT(course_of(again) == course_of(scene));
      RC_ASSERT(scene::standalone_text(again.resolved, again.inputs) == text);
      ++repeated;
    } catch (const Error& error) {
      // The generator draws some that are refused; what is written down is not.
      if (error.problems().empty() || error.problems()[0].place->file == "/nowhere/resolved.yaml")
        RC_FAIL(error.what());
    }
  });
  EXPECT_TRUE(held);
  EXPECT_GT(repeated, test::kDrawnCases / 2);
}

/// Angles of one joint over 0.1 s.
std::string wave(double degrees) {
  return "time[s],index_mcp.flexion[deg]\n0,0\n0.1," + std::to_string(degrees) + "\n";
}

const std::string kOneJoint =
    "control.controller.gains=[{joints: index_mcp.flexion, frequency: 8 Hz, damping_ratio: 1, torque_limit: "
    "1}]";

/// Both hands of a shipped scene, each after its file.
scene::Scene waving(const fs::path& right, const fs::path& left, std::vector<std::string> more = {}) {
  more.insert(more.begin(), {"control.program={right: " + right.string() + ", left: " + left.string() + "}",
                             kOneJoint, "criteria={}", "duration=0.1"});
  return shipped_scene("every_pose", more);
}

TEST(Resolved, HoldsItsMotionFilesTwoOfOneNameAsWell) {
  const TemporaryFolder folder;
  const fs::path right = write(folder.path() / "a" / "wave.csv", wave(40));
  const fs::path left = write(folder.path() / "b" / "wave.csv", wave(20));
  const scene::Scene scene = waving(right, left);
  fs::remove_all(folder.path() / "a");
  fs::remove_all(folder.path() / "b");
  expect_repeated(scene, folder);
  EXPECT_EQ(text_of(folder.path() / "again" / "inputs" / "wave.csv"), wave(40));
  EXPECT_EQ(text_of(folder.path() / "again" / "inputs" / "wave-2.csv"), wave(20));
  EXPECT_EQ(scene.inputs.size(), 2U);
}

// The grasp study runs a scene with another friction of every surface.
TEST(Resolved, SaysTheFrictionThatTheRunHad) {
  const TemporaryFolder folder;
  scene::Scene scene = shipped_scene("grasp_cup", {"duration=0.05", "criteria={}"});
  study::set_friction(scene, 0.05);
  expect_repeated(scene, folder);
  const scene::Scene again = scene::load_scene(folder.path() / "again" / "resolved.yaml");
  ASSERT_EQ(again.model.materials.size(), scene.model.materials.size());
  for (std::size_t i = 0; i < again.model.materials.size(); ++i) {
    EXPECT_EQ(again.model.materials[i].friction, 0.05);
    EXPECT_EQ(again.model.materials[i].spinning_friction, scene.model.materials[i].spinning_friction);
  }
}

TEST(Resolved, HoldsItsMeshes) {
  const TemporaryFolder folder;
  const fs::path there = folder.path() / "there";
  fs::create_directories(there);
  fs::copy(source("tests/data/meshes/icosahedron.obj"), there / "a stone.obj");
  const fs::path file = write(there / "scene.yaml",
                              "objects:\n  - {name: stone, shape: convex_mesh, mesh: a stone.obj, scale: "
                              "0.05, mass: 1, position: [0, 0, 0.06]}\n"
                              "  - {name: two, parts: [{shape: convex_mesh, mesh: a stone.obj, scale: "
                              "0.02}], mass: 1, position: [1, 0, 1]}\n"
                              "bodies: [{name: b, mass: 1, inertia: [1, 1, 1], position: [2, 0, 0], shape: "
                              "{kind: convex_mesh, mesh: ./a "
                              "stone.obj}}]\nground: {}\nduration: 0.2\n");
  const scene::Scene scene = scene::load_scene(file);
  fs::remove_all(there);
  expect_repeated(scene, folder);
  EXPECT_EQ(scene.inputs.size(), 1U);
  EXPECT_TRUE(fs::exists(folder.path() / "again" / "inputs" / "a_stone.obj"));
}

TEST(Resolved, AThousandMugsAreReadAgain) {
  HANDSIM_SKIP_WITH_SANITIZER("one mug is read by the same code");
  std::string text = "objects:\n";
  for (int i = 0; i < 1000; ++i)
    text += fmt::format("  - {{name: mug{}, file: {}, position: [{}, {}, 0.2]}}\n", i,
                        source("config/objects/mug.yaml").string(), 0.2 * (i % 32), 0.2 * (i / 32));
  const scene::Scene scene =
      scene::compile_scene(parse_yaml(text + "ground: {}\nduration: 1\n", "mugs.yaml"));
  const std::string resolved = scene::standalone_text(scene.resolved, scene.inputs);
  const scene::Scene again = scene::compile_scene(parse_yaml(resolved, "/nowhere/resolved.yaml"));
  EXPECT_EQ(scene::standalone_text(again.resolved, again.inputs), resolved);
  EXPECT_EQ(again.model.bodies.size(), scene.model.bodies.size());
}

TEST(Resolved, WhatCouldNotBeReadAgainIsRefusedBeforeTheRun) {
  const TemporaryFolder folder;
  const fs::path file =
      write(folder.path() / "long.yaml",
            "{shape: sphere, radius: 0.01, mass: 1, source: \"" + std::string(140'000, 'x') + "\"}\n");
  std::string text = "objects:\n";
  for (int i = 0; i < 250; ++i)
    text += fmt::format("  - {{name: b{}, file: {}, position: [{}, 0, 0]}}\n", i, file.string(), 0.1 * i);
  const scene::Scene scene = scene::compile_scene(parse_yaml(text + "duration: 1\n", "long.yaml"));
  try {
    run_in(scene, folder.path() / "out");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("so that resolved.yaml can be read again"), std::string::npos)
        << error.what();
  }
  EXPECT_FALSE(fs::exists(folder.path() / "out" / "summary.json"));
}

TEST(OwnFolder, WhatARunReadsItDoesNotWriteOver) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const fs::path program = write(out / "trajectory.csv", wave(40));
  try {
    run_in(waving(program, program), folder.path() / "." / "out");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("the run would overwrite its own input"), std::string::npos)
        << error.what();
  }
  EXPECT_EQ(text_of(program), wave(40));
  EXPECT_FALSE(fs::exists(out / "summary.json"));
  fs::remove(program);
  // Under another name it stands there unharmed; a run from resolved.yaml goes to another folder.
  const fs::path other = write(out / "wave.csv", wave(40));
  const RunResult first = run_in(waving(other, other), out);
  EXPECT_THROW(run_in(scene::load_scene(out / "resolved.yaml"), out), Error);
  EXPECT_EQ(run_in(scene::load_scene(out / "resolved.yaml"), folder.path() / "again").state_hash,
            first.state_hash);
  EXPECT_EQ(text_of(other), wave(40));
  EXPECT_EQ(text_of(out / "inputs" / "wave.csv"), wave(40));
}

// The folder holds the copies of the last run alone, and whatever else has been put there.
TEST(OwnFolder, CopiesOfAnEarlierRunAreRemovedAndNothingElse) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const fs::path first = write(folder.path() / "first.csv", wave(40));
  const fs::path second = write(folder.path() / "second.csv", wave(20));
  run_in(waving(first, first), out);
  EXPECT_TRUE(fs::exists(out / "inputs" / "first.csv"));
  const fs::path mine = write(out / "inputs" / "mine.csv", wave(10));
  run_in(waving(second, second), out);
  EXPECT_FALSE(fs::exists(out / "inputs" / "first.csv"));
  EXPECT_EQ(text_of(out / "inputs" / "second.csv"), wave(20));
  fs::remove(mine);
  run_in(shipped_scene("every_pose", {"criteria={}", "duration=1 ms"}), out);
  EXPECT_FALSE(fs::exists(out / "inputs"));
}

// No path may lead a run to files that no run has written.
TEST(OwnFolder, AnEarlierResolvedSceneNamesNothingOutsideInputs) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const fs::path mine = write(folder.path() / "mine.csv", wave(10));
  const fs::path inside = write(out / "mine.csv", wave(10));
  for (const std::string& path :
       {mine.string(), std::string("inputs/../mine.csv"), std::string("inputs/*"), std::string("mine.csv")}) {
    const fs::path kept = write(out / "inputs" / "kept.csv", wave(10));
    write(out / "resolved.yaml", "control: {program: \"" + path + "\"}\n");
    run_in(shipped_scene("every_pose", {"criteria={}", "duration=1 ms"}), out);
    for (const fs::path& file : {mine, inside, kept}) EXPECT_EQ(text_of(file), wave(10)) << path;
  }
}

TEST(OwnFolder, ACopyDoesNotReplaceAnotherInput) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const fs::path mine = write(out / "inputs" / "wave.csv", wave(10));
  const fs::path other = write(folder.path() / "wave.csv", wave(40));
  EXPECT_THROW(run_in(waving(other, mine), out), Error);
  EXPECT_EQ(text_of(mine), wave(10));
}

TEST(SnapshotOfAMotion, IsRefusedWhereTheMotionHasChangedAndTakenWhereItHasMoved) {
  const TemporaryFolder folder;
  const fs::path file = write(folder.path() / "wave.csv", wave(40));
  RunOptions options;
  options.out = folder.path() / "whole";
  options.snapshot_at = 0.05;
  const RunResult whole = run(waving(file, file), options);
  RunOptions rest;
  rest.out = folder.path() / "rest";
  rest.from_snapshot = options.out / "snapshot.bin";
  const fs::path moved = write(folder.path() / "elsewhere" / "wave.csv", wave(40));
  EXPECT_EQ(run(waving(moved, moved), rest).state_hash, whole.state_hash);
  write(file, wave(20));
  try {
    run(waving(file, file), rest);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("differs in inputs/wave.csv"), std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace handsim::simulation
