// Inverse dynamics on the command line; tests/python/test_track.py has the day at the bench.
#include <gtest/gtest.h>

#include "app/program.h"

namespace handsim {
namespace {

using test::contains;
using test::Outcome;
using test::run_program;
using test::source;
using test::TemporaryFolder;

// A force of 5 N on a fingertip that the simulation does not have: its torques do not return to the motion.
TEST(InverseCommand, ACheckThatMissesIsAFailure) {
  const TemporaryFolder folder;
  test::write(folder.path() / "contacts.csv",
              "time[s],a,b,x[m],y[m],z[m],normal.x,normal.y,normal.z,depth[m],normal_force[N],friction.x[N],"
              "friction.y[N],"
              "friction.z[N]\n0,right.index_distal,right.middle_distal,0,0,0,0,0,1,0,5,0,0,0\n"
              "1,right.index_distal,right.middle_distal,0,0,0,0,0,1,0,5,0,0,0\n");
  std::vector<std::string> command = {"inverse", source("config/every_pose.yaml"),
                                      "--loads", (folder.path() / "contacts.csv").string(),
                                      "--out",   (folder.path() / "out").string(),
                                      "--set",   "duration=0.5",
                                      "--set",   "criteria={}"};
  const Outcome missed = run_program(command);
  EXPECT_EQ(missed.status, 1) << missed.out;
  EXPECT_TRUE(contains(missed.err, "the check misses the motion: RMS error")) << missed.err;
  command.emplace_back("--no-check");
  const Outcome unchecked = run_program(command);
  EXPECT_EQ(unchecked.status, 0) << unchecked.err;
  EXPECT_TRUE(contains(unchecked.out, "not checked"));
}

TEST(InverseCommand, BadInputIsRefusedWithItsPlace) {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  const auto expect = [](const Outcome& outcome, const char* part) {
    EXPECT_EQ(outcome.status, 2);
    EXPECT_TRUE(contains(outcome.err, part)) << outcome.err;
  };
  expect(run_program({"inverse", source("config/two_hands.yaml"), "--out", out}),
         "a motion file, or programs of the scene");
  expect(run_program({"inverse", source("config/dropped_hand.yaml"), "--motion", "x.csv", "--out", out}),
         "a hand whose palm is not held");
}

}  // namespace
}  // namespace handsim
