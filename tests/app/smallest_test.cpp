// The program built without pictures (CMake option HANDSIM_PICTURES=OFF) and without SUNDIALS.
#include <gtest/gtest.h>

#include "app/program.h"

namespace handsim::test {
namespace {

namespace fs = std::filesystem;

const std::string kScene = source("config/dropped_hand.yaml").string();

TEST(NoPictures, RenderIsRefusedBeforeAnythingIsRun) {
  const TemporaryFolder folder;
  const fs::path picture = folder.path() / "p.png";
  const Outcome outcome = run_program({"render", kScene, "--out", picture.string()});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_EQ(outcome.err, "handsim: got a build without pictures, need a build with -DHANDSIM_PICTURES=ON\n");
  EXPECT_FALSE(fs::exists(picture));
}

TEST(NoPictures, RunsAreCompleteExceptForRequestedFrames) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  std::vector<std::string> command = {"run",        kScene,  "--quiet",      "--out",
                                      out.string(), "--set", "duration=0.01"};
  Outcome outcome = run_program(command);
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_TRUE(fs::exists(out / "summary.json"));
  command.insert(command.end(), {"--frames", "2"});
  outcome = run_program(command);
  EXPECT_EQ(outcome.status, 1);
  EXPECT_TRUE(contains(outcome.err, "missing: pictures: handsim: got a build without pictures"))
      << outcome.err;
  EXPECT_TRUE(fs::exists(out / "summary.json"));
  EXPECT_FALSE(fs::exists(out / "frame_000.png"));
}

const std::string kCrank = source("config/slider_crank_iftomm.yaml").string();
constexpr const char* kNoGear =
    "got stabilised_gear in a program that was built without SUNDIALS, need ./dev build, which installs it "
    "(libsundials-dev), or another method";

TEST(NoSundials, ItsMethodIsRefusedAtItsPlace) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const std::vector<std::string> command = {"run", kCrank, "--quiet", "--out", out.string(), "--set"};
  // By default dae has this method: then the place is that of the block in the file.
  for (const auto& [set, place] :
       {std::pair{"solver.engine=dae", kCrank + ":39:9: "},
        {"solver={engine: dae, method: stabilised_gear}", "--set solver:1:23: "}}) {
    std::vector<std::string> each = command;
    each.emplace_back(set);
    const Outcome outcome = run_program(each);
    EXPECT_EQ(outcome.status, 2);
    EXPECT_EQ(outcome.problems(), std::vector{place + "solver.method: " + kNoGear});
    EXPECT_FALSE(fs::exists(out));
  }
  std::vector<std::string> other = command;
  other.emplace_back("solver={engine: dae, method: euler_projected}");
  EXPECT_EQ(run_program(other).status, 0);
}

TEST(NoSundials, EngineAutoTakesTheNextMethod) {
  const TemporaryFolder folder;
  write(folder.path() / "costs.yaml",
        "kinds:\n- {kind: tree, scene: ball, duration: 1, rows: [\n"
        "  {error: 1e-9, cost: 1e-9, engine: dae, method: stabilised_gear, step: 0.01},\n"
        "  {error: 1e-3, cost: 1, engine: dae, method: lagrange_penalty, step: 0.01}]}\n");
  const fs::path scene =
      write(folder.path() / "scene.yaml",
            kBallScene + std::string("effects: [gravity]\nsolver: {engine: auto, costs: costs.yaml}\n"));
  const fs::path out = folder.path() / "out";
  const Outcome outcome =
      run_program({"run", scene.string(), "--quiet", "--out", out.string(), "--set", "duration=0.02"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_TRUE(contains(text_of(out / "summary.json"), "\"engine_choice\": \"dae lagrange_penalty"));
}

}  // namespace
}  // namespace handsim::test
