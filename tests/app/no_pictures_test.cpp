// The program built without pictures (CMake option HANDSIM_PICTURES=OFF).
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

}  // namespace
}  // namespace handsim::test
