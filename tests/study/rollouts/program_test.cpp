// One rollout of a study as a user runs it again; the command itself is tested in
// tests/python/test_rollouts.py.
#include <gtest/gtest.h>

#include "app/program.h"
#include "study/rollouts/studies.h"

namespace handsim {
namespace {

using test::contains;
using test::Outcome;
using test::run_program;
namespace fs = std::filesystem;

// Oracle: the row's state_hash, and a run's files.
TEST(RolloutsProgram, OneIsRunAgainWithItsFiles) {
  const test::TemporaryFolder folder;
  const fs::path study = test::write_study(folder.path()), again = folder.path() / "again";
  std::istringstream csv(test::table_of(study));
  std::string row;
  for (int i = 0; i < 9; ++i) std::getline(csv, row);
  const std::string hash = row.substr(row.rfind(',') + 1);
  const Outcome outcome = run_program({"run", study.string(), "--rollout", "7", "--out", again.string(),
                                       "--expect-hash", hash, "--frames", "1"});
  EXPECT_FALSE(contains(outcome.err, "state hash")) << outcome.err;
  EXPECT_TRUE(contains(test::text_of(again / "summary.json"), hash));
  for (const char* file : {"trajectory.csv", "resolved.yaml", "frame_000.png"})
    EXPECT_TRUE(fs::exists(again / file)) << file;
  const Outcome beyond = run_program({"run", study.string(), "--rollout", "12", "--out", again.string()});
  EXPECT_EQ(beyond.status, 2);
  EXPECT_TRUE(contains(beyond.err, "--rollout: got 12, need 0 to 11")) << beyond.err;
}

}  // namespace
}  // namespace handsim
