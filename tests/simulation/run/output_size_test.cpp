// What a run writes, and what it keeps in memory meanwhile.
#include "handsim/simulation/run/output_size.h"

#include <gtest/gtest.h>

#include "handsim/simulation/run/run.h"
#include "scene_files.h"
#include "support/peak_memory.h"

namespace handsim::simulation {
namespace {

using test::peak_memory;
using test::shipped_scene;

// Oracle: counting.
TEST(RecordRows, AreTheStepsThatTheIntervalDivides) {
  for (long first = 0; first < 12; ++first)
    for (long last = first; last < 25; ++last)
      for (long every = 1; every < 8; ++every) {
        long rows = 0;
        for (long i = first; i <= last; ++i) rows += i % every == 0 ? 1 : 0;
        EXPECT_EQ(record_rows(first, last, every), rows) << first << " " << last << " " << every;
      }
}

// Oracle: the files of the run. Numbers of shipped scenes have 14.8 to 20.6 bytes, assumed are 19, of
// muscles 17: within 15 %.
TEST(OutputSize, IsThatOfTheTablesThatTheRunWrites) {
  for (const auto& [name, duration] :
       {std::pair("two_hands", "1"), std::pair("pose_tracking", "3"), std::pair("muscle_poses", "1")}) {
    const test::TemporaryFolder folder;
    const scene::Scene scene = shipped_scene(name, {std::string("duration=") + duration});
    RunOptions options;
    options.out = folder.path();
    run(scene, options);
    double bytes = 0;
    for (const char* file : {"trajectory.csv", "trajectory.mot", "control.sto", "muscles.sto"})
      if (std::filesystem::exists(folder.path() / file))
        bytes += static_cast<double>(std::filesystem::file_size(folder.path() / file));
    const long steps = std::lround(scene.spec.duration / scene.spec.solver.step);
    const OutputSize size = output_size(scene, 0, steps, 0);
    EXPECT_NEAR(size.total(), bytes, 0.15 * bytes) << name;
    EXPECT_FALSE(check_room(scene, size, folder.path()).has_value());
  }
}

// 100 s at every microsecond. No disk has 10^20 bytes.
TEST(OutputSize, BeyondTheRoomIsRefusedWithAnIntervalThatFits) {
  const test::TemporaryFolder folder;
  const scene::Scene scene =
      shipped_scene("two_hands", {"duration=100", "solver.step=1e-6", "record.every=1e-6"});
  OutputSize size = output_size(scene, 0, 100'000'000, 0);
  EXPECT_EQ(size.rows, 100'000'001);
  EXPECT_GT(size.total(), 100e9);
  size.row *= 1e9;
  try {
    check_room(scene, size, folder.path() / "not" / "there" / "yet");
    FAIL();
  } catch (const Error& error) {
    const std::string text = error.what();
    EXPECT_TRUE(text.starts_with("record.every: got about ")) << text;
    EXPECT_NE(text.find(" are free, need "), std::string::npos) << text;
  }
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "not"));
}

TEST(OutputSize, OfManyPicturesCountsTheMemoryOfTheirMoments) {
  const scene::Scene scene = shipped_scene("two_hands");
  EXPECT_LT(output_size(scene, 0, 2000, 10'000).moments, 1e9);
  OutputSize size = output_size(scene, 0, 2000, 10'000);
  size.moments *= 60;
  EXPECT_THROW(check_room(scene, size, "."), Error);
}

// Oracle: the bytes of trajectory.mot and control.sto, which would be in memory if rows did not go to the
// disk.
TEST(LongRun, TakesNoMoreMemoryThanAShortOne) {
  const auto bytes_of_run = [](const char* duration) {
    const test::TemporaryFolder folder;
    RunOptions options;
    options.out = folder.path();
    run(shipped_scene("pose_tracking", {std::string("duration=") + duration, "record.every=1e-3"}), options);
    return static_cast<double>(std::filesystem::file_size(folder.path() / "trajectory.mot") +
                               std::filesystem::file_size(folder.path() / "control.sto"));
  };
  bytes_of_run("0.5");
  const double before = peak_memory();
  const double bytes = bytes_of_run("10");
  EXPECT_GT(bytes, 20e6);
  EXPECT_LT(peak_memory() - before, 0.2 * bytes);
}

}  // namespace
}  // namespace handsim::simulation
