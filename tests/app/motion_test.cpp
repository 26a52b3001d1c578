// The day at the bench on the command line: a run records keypoints, track follows them, inverse computes
// torques, and a run plays the tracked scene.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "app/program.h"

namespace handsim {
namespace {

using test::contains;
using test::Outcome;
using test::run_program;
using test::source;
using test::TemporaryFolder;

// Oracle: the motion that was recorded; the tracked angles lead through inverse dynamics and a run back to
// it. 0.01 deg: the joints of ODE open by 1e-4 mm.
TEST(DayAtTheBench, LeadsFromKeypointsToTorquesAndBack) {
  const TemporaryFolder folder;
  const auto path = [&](const char* name) { return (folder.path() / name).string(); };
  ASSERT_EQ(run_program({"run", source("config/bench.yaml"), "--out", path("true"), "--quiet", "--set",
                         "duration=0.6 s"})
                .status,
            0);
  const Outcome tracked = run_program({"track", path("true/markers.csv"), "--out", path("tracked"), "--truth",
                                       path("true/trajectory.mot"), "--person",
                                       source("config/persons/median_woman.yaml"), "--json"});
  ASSERT_EQ(tracked.status, 0) << tracked.err;
  const nlohmann::json summary = nlohmann::json::parse(tracked.out);
  ASSERT_EQ(summary.at("hands").size(), 2);
  for (const nlohmann::json& hand : summary.at("hands")) {
    EXPECT_EQ(hand.at("tracked"), 76);
    EXPECT_LT(hand.at("difference_rms_deg").get<double>(), 0.01);
  }
  if (std::string_view(HANDSIM_PYTHON_PROGRAM).empty()) GTEST_SKIP() << "built without the Python package";
  const Outcome torques =
      run_program({"inverse", path("tracked/scene.yaml"), "--out", path("torques"), "--json", "--set",
                   "effects=[gravity, joint_stops, passive_tissue, actuation, wrist_motion]"});
  ASSERT_EQ(torques.status, 0) << torques.err;
  // OpenSim calls its `_moment` what handsim calls `_active`: no column has the name with another meaning.
  const std::string table = test::text_of(path("torques/torques.sto"));
  EXPECT_TRUE(test::contains(table, "index_pip.flexion_active"));
  EXPECT_FALSE(test::contains(table, "_moment"));
  EXPECT_LT(nlohmann::json::parse(torques.out).at("forward").at("rms_error_deg").get<double>(), 0.1);
  const Outcome again = run_program({"run", path("tracked/scene.yaml"), "--out", path("again"), "--json"});
  ASSERT_EQ(again.status, 0) << again.err;
}

// A shipped person is not to blame for the order of the points.
TEST(DayAtTheBench, PointsInAnotherOrderThatMakeNoHandAreAProblemOfTheRecording) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_program({"run", source("config/bench.yaml"), "--out", folder.path() / "true", "--quiet",
                         "--set", "duration=0.1 s"})
                .status,
            0);
  // The right hand's columns, with the names in reverse.
  std::istringstream lines(test::text_of(folder.path() / "true/markers.csv"));
  std::string head, rows;
  std::getline(lines, head);
  std::vector<std::string> names, reversed;
  std::istringstream words(head);
  for (std::string word; std::getline(words, word, ',') && !word.starts_with("left.");) names.push_back(word);
  ASSERT_EQ(names.size(), 64U);
  reversed.push_back(names.front());
  for (std::size_t point = names.size(); point > 1; point -= 3)
    reversed.insert(reversed.end(), names.begin() + static_cast<std::ptrdiff_t>(point - 3),
                    names.begin() + static_cast<std::ptrdiff_t>(point));
  const auto row = [&rows](const std::vector<std::string>& cells) {
    for (std::size_t i = 0; i < 64; ++i) rows += (i > 0 ? "," : "") + cells.at(i);
    rows += "\n";
  };
  row(reversed);
  for (std::string line; std::getline(lines, line);) {
    std::vector<std::string> cells;
    std::istringstream in(line);
    for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
    row(cells);
  }
  const std::string recording = test::write(folder.path() / "reversed.csv", rows);
  const Outcome outcome = run_program({"track", recording, "--out", folder.path() / "out"});
  EXPECT_EQ(outcome.status, 2);
  // A line of its own; a slow run has told its progress before.
  EXPECT_TRUE(test::contains("\n" + outcome.err, "\n" + recording + ": got points that make no hand: "))
      << outcome.err;
  EXPECT_FALSE(test::contains(outcome.err, "median_man")) << outcome.err;
  // Every kind of recording is named.
  const Outcome other =
      run_program({"track", test::write(folder.path() / "a.txt", "1"), "--out", folder.path() / "out"});
  EXPECT_TRUE(test::contains(other.err, "need a recording: .csv, .json, .trc or .c3d")) << other.err;
}

TEST(DayAtTheBench, ARecordingWithoutATrackedFrameIsAFailure) {
  const TemporaryFolder folder;
  std::string head = "time[s]", row;
  for (const char* name : {"wrist", "index_mcp", "little_mcp"})
    for (const char* axis : {"x", "y", "z"}) head += std::string(",right.") + name + "." + axis + "[m]";
  for (int k = 0; k < 5; ++k) row += std::to_string(k) + ",0,0,0,-0.03,0.09,0,0.03,0.08,0\n";
  test::write(folder.path() / "palm.csv", head + "\n" + row);
  std::vector<std::string> command = {"track", (folder.path() / "palm.csv").string(), "--out",
                                      (folder.path() / "out").string()};
  const Outcome refused = run_program(command);
  EXPECT_EQ(refused.status, 2);
  EXPECT_TRUE(contains(refused.err, "fewer than three frames that show a hand")) << refused.err;
  command.emplace_back("--keep-person");
  const Outcome done = run_program(command);
  EXPECT_EQ(done.status, 1);
  EXPECT_TRUE(contains(done.err, "no frame of any hand is tracked")) << done.err;
}

TEST(DayAtTheBench, BadInputIsRefusedWithItsPlace) {
  const TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  const auto expect = [](const Outcome& outcome, const char* part) {
    EXPECT_EQ(outcome.status, 2);
    EXPECT_TRUE(contains(outcome.err, part)) << outcome.err;
  };
  test::write(folder.path() / "empty.csv",
              "time[s],right.wrist.x[m],right.wrist.y[m],right.wrist.z[m]\n0,,,\n");
  expect(run_program({"track", (folder.path() / "empty.csv").string(), "--out", out}),
         "no frame in which a point of a hand was seen");
  test::write(folder.path() / "names.csv", "time[s],wrist.x[m],wrist.y[m],wrist.z[m]\n0,1,2,3\n");
  expect(run_program({"track", (folder.path() / "names.csv").string(), "--out", out}),
         "no point of a hand, but wrist");
  expect(run_program({"track", "none.csv", "--out", out}), "no such file");
}

}  // namespace
}  // namespace handsim
