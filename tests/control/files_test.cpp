// Controller files, programs and tables of angles: what is read, and what is refused with its
// place.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "handsim/control/motion_file.h"
#include "handsim/output/table/table_files.h"
#include "scene_files.h"

namespace handsim::control {
namespace {

/// The first problem of a shipped scene with changes; empty if it compiles.
std::string refused(const std::vector<std::string>& overrides, const std::string& scene = "every_pose") {
  try {
    test::shipped_scene(scene, overrides);
    return "";
  } catch (const Error& error) {
    return error.problems().front().text();
  }
}

void expect_text(const std::string& text, const std::vector<std::string>& parts) {
  for (const std::string& part : parts)
    EXPECT_NE(text.find(part), std::string::npos) << part << " in: " << text;
}

/// A table of angles for the right hand in a folder of its own.
std::filesystem::path table(const test::TemporaryFolder& folder, const std::string& name,
                            const std::string& text) {
  std::ofstream(folder.path() / name) << text;
  return folder.path() / name;
}

std::string problem_of(const std::filesystem::path& path) {
  try {
    read_motion(path);
    return "";
  } catch (const Error& error) {
    return error.problems().front().text();
  }
}

TEST(BadInput, OutOfRangePoseNamesJointValueAndRange) {
  expect_text(refused({"control.poses.poses.fist.index_pip=120"}),
              {"poses.fist.index_pip", "120 deg for index_pip.flexion", "0 to 100 deg"});
}

TEST(BadInput, UnknownNamesAreRefusedWithTheNearest) {
  expect_text(refused({"control.program=every_pos"}),
              {"control.program", "unknown program", "nearest: every_pose"});
  expect_text(refused({"control.poses.programs.every_pose.keys.3.pose=fits"}),
              {"keys.3.pose", "unknown pose", "nearest: fist"});
  expect_text(refused({"control.poses.poses.fist.indx_mcp=10"}),
              {"indx_mcp", "the hand does not have", "nearest: index_mcp"});
  expect_text(refused({"control.controller.gains.4.joints=index_mpc"}),
              {"index_mpc", "no hand", "nearest: index_mcp"});
  expect_text(refused({"control.controller.gians=1"}), {"gians", "unknown key", "nearest: gains"});
}

TEST(BadInput, GainsThatAreNegativeOrNotANumberAreRefused) {
  expect_text(refused({"control.controller.gains.0={joints: all, proportional: -1, derivative: 1}"}),
              {"proportional", "-1", "0 to"});
  expect_text(refused({"control.controller.gains.0={joints: all, frequency: .nan, damping_ratio: 1}"}),
              {"frequency", "nan"});
  expect_text(
      refused(
          {"control.controller.gains.0={joints: all, frequency: 5 Hz, damping_ratio: 1, proportional: 2}"}),
      {"given and designed"});
  expect_text(refused({"control.controller.gains=[{joints: all, frequency: 5 Hz, damping_ratio: 1}]"}),
              {"no torque_limit"});
  expect_text(refused({"control.controller.gains.0={joints: all, torque_limit: 1}"}), {"no gains"});
}

TEST(BadInput, ProgramTimesMustIncreaseAndLeaveTimeToMove) {
  expect_text(refused({"control.poses.programs.every_pose.keys.4.time=1"}),
              {"keys.4.time", "1 s after 3.6 s", "increasing"});
  expect_text(refused({"control.poses.programs.every_pose.keys.4.time=3.6"}),
              {"keys.4.time", "3.6 s after 3.6 s", "increasing"});
  expect_text(refused({"control.poses.programs.every_pose.keys.4.time=3.7"}),
              {"keys.4.time", "lasts until 4.1 s"});
}

TEST(BadInput, EveryHandNeedsAProgram) {
  expect_text(refused({"control.program={right: every_pose}"}),
              {"control.program", "no program for hand left"});
  expect_text(refused({"control.program={right: every_pose, left: every_pose, lift: every_pose}"}),
              {"lift", "the scene does not have"});
  expect_text(refused({"control.poses.programs.every_pose={hands: {right: [{time: 0, pose: fist}]}}"}),
              {"no keys for hand left"});
}

TEST(BadInput, ActuationAndControlGoTogether) {
  expect_text(refused({"effects=[gravity]"}), {"a control block without actuation"});
  expect_text(refused({"effects=[actuation]"}, "two_hands"),
              {"actuation without a control block or a joint with a torque"});
}

TEST(BadInput, ExplicitGainsBeyondTheirLimitNameTheJointTheLimitAndTheWaysOut) {
  const std::vector<std::string> stiff = {"control.controller.form=explicit"};
  expect_text(refused(stiff),
              {"gains.right.", "2 D h/I + K h^2/I", "below 4", "form: implicit", "a step below"});
  const scene::Scene allowed =
      test::shipped_scene("every_pose", {"control.controller.form=explicit", "control.allow_unstable=true"});
  ASSERT_FALSE(allowed.warnings.empty());
  expect_text(allowed.warnings.back(), {"allow_unstable"});
}

constexpr const char* kHeader = "test\nversion=1\nnRows=2\nnColumns=3\ninDegrees=yes\nendheader\n";

TEST(MotionFile, ReadsOpenSimTablesInDegrees) {
  const test::TemporaryFolder folder;
  const auto path = table(
      folder, "a.mot",
      std::string(kHeader) + "time\t/jointset/x/right.index_mcp.flexion/value  b\n0 10\t20\n0.5 -30 40\n");
  const MotionTable read = read_motion(path);
  EXPECT_EQ(read.names, (std::vector<std::string>{"right.index_mcp.flexion", "b"}));
  EXPECT_EQ(read.times, (std::vector<double>{0, 0.5}));
  EXPECT_DOUBLE_EQ(read.at(1, 0), -30 * kDegree);
}

TEST(MotionFile, ReadsCsvWithUnitsInItsHeader) {
  const test::TemporaryFolder folder;
  const MotionTable read = read_motion(
      table(folder, "a.csv", "time[s],a[deg],b[rad],a.rate[rad/s],palm.x[m],palm.qw,c\n0,90,1,5,6,7,2\n"));
  EXPECT_EQ(read.names, (std::vector<std::string>{"a", "b", "c"}));
  EXPECT_DOUBLE_EQ(read.at(0, 0), M_PI / 2);
  EXPECT_EQ(read.at(0, 2), 2);
}

TEST(MotionFile, RefusesInvalidTablesWithLineAndColumn) {
  const test::TemporaryFolder folder;
  const std::string header = kHeader;
  const auto mot = [&](const std::string& text) { return problem_of(table(folder, "a.mot", text)); };
  expect_text(mot(header + "time\ta\n0\t1\n1\t1\n"), {"a.mot:7:1", "2 labels", "3, the value of nColumns"});
  expect_text(mot(header + "time\ta\tb\n0\t1\n"), {"a.mot:8:1", "2 values", "3, one for each column"});
  expect_text(mot(header + "time\ta\tb\n0\t1\tx\n"), {"a.mot:8:5", "\"x\"", "a finite number"});
  expect_text(mot(header + "time\ta\tb\n0\t1\tnan\n"), {"a.mot:8:5", "nan"});
  expect_text(mot(header + "time\ta\tb\n1\t1\t1\n1\t1\t1\n"), {"a.mot:9:1", "increasing times"});
  expect_text(mot(header + "time\ta\tb\n0\t1\t1\n"), {"nRows", "1 rows", "2"});
  expect_text(mot("x\nnRows=2\n"), {"endheader"});
  // Larger than any integer type.
  expect_text(mot("x\nnRows=1e99\nendheader\n"), {"nRows", "\"1e99\"", "a whole number, at most 1e9"});
  expect_text(mot(header + "time\ta\ta\n"), {"a.mot:7:8", "second column"});
  expect_text(problem_of(table(folder, "a.csv", "t,a\n")), {"a.csv:1:1", "time[s]"});
  expect_text(problem_of(table(folder, "a.csv", "time,a[furlong]\n")), {"a.csv:1:6", "[furlong]"});
  expect_text(problem_of(folder.path() / "none.csv"), {"no such file"});
}

TEST(MotionFile, AnglesBeyondTheRangeAreRefused) {
  const test::TemporaryFolder folder;
  const std::string one =
      "control.controller.gains=[{joints: index_mcp.flexion, frequency: 8 Hz, damping_ratio: 1, "
      "torque_limit: 1}]";
  const auto far = table(folder, "b.csv", "time,index_mcp.flexion[deg]\n0,10\n1,120\n");
  expect_text(refused({"control.program=" + far.string(), one}),
              {"b.csv:3:1", "right.index_mcp.flexion", "120 deg at 1 s", "-45 to 90 deg"});
  const auto near = table(folder, "c.csv", "time,index_mcp.flexion[deg]\n0,10\n1,90.3\n");
  const scene::Scene moved =
      test::shipped_scene("every_pose", {"control.program=" + near.string(), one, "criteria={}"});
  expect_text(moved.warnings.front(), {"c.csv", "1 angles of hand right"});
}

// control.sto as a run writes it: the targets are the angles of the program.
TEST(MotionFile, ReadsTheTargetsOfAControlTable) {
  const test::TemporaryFolder folder;
  const MotionTable read = read_motion(table(folder, "control.sto",
                                             "test\nversion=1\nnRows=1\nnColumns=4\ninDegrees=no\nendheader\n"
                                             "time\tright.a.flexion.target[deg]\tright.a.flexion.angle[deg]"
                                             "\tright.a.flexion.torque[N_m]\n0\t90\t80\t1\n"));
  EXPECT_EQ(read.names, (std::vector<std::string>{"right.a.flexion", "right.a.flexion.angle"}));
  EXPECT_DOUBLE_EQ(read.at(0, 0), M_PI / 2);
}

// Oracle: the numbers given; 1e-15 is the rounding of degrees.
TEST(MotionFile, WhatIsWrittenReadsBack) {
  const test::TemporaryFolder folder;
  output::MotionTableWriter writer(folder.path() / "a.mot",
                                   {"angles", {"right.a.flexion", "right.b.flexion"}, 2});
  const std::vector<std::vector<double>> rows = {{0.1, -0.2}, {1.0 / 3, 1.5}};
  for (std::size_t i = 0; i < rows.size(); ++i)
    writer.add(0.25 * static_cast<double>(i),
               std::vector<double>{kDegreesPerRadian * rows[i][0], kDegreesPerRadian * rows[i][1]});
  writer.finish();
  const MotionTable read = read_motion(folder.path() / "a.mot");
  EXPECT_EQ(read.names, (std::vector<std::string>{"right.a.flexion", "right.b.flexion"}));
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (std::size_t k = 0; k < 2; ++k) EXPECT_NEAR(read.at(i, k), rows[i][k], 1e-15);
}

}  // namespace
}  // namespace handsim::control
