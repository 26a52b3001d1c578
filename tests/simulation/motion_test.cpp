// Recorded motion in a run: feed-forward, and the tables that a scene asks for.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include <fmt/format.h>

#include "handsim/model/kinematics.h"
#include "handsim/simulation/run/run.h"
#include "handsim/simulation/run/run_tables.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"
#include "smooth_motion.h"

namespace handsim::simulation {
namespace {

std::string controller_file(const char* name) {
  return std::string("control.controller=") + test::in_source("controllers/") + name + ".yaml";
}

/// RMS tracking error of both hands through the smooth motion [deg].
double tracking_error(const char* controller) {
  const test::TemporaryFolder folder;
  const scene::Scene plain = test::shipped_scene("every_pose", {"criteria={}"});
  const std::filesystem::path motion = folder.path() / "motion.csv";
  test::write_smooth_motion(motion, plain.model);
  std::vector<std::string> pose;
  Simulation simulation(test::shipped_scene(
      "every_pose",
      {"criteria={}", "duration=5 s", controller_file(controller), "control.program=" + motion.string()}));
  // From the motion's own start, not from straight fingers.
  model::State start = model::initial_state(simulation.model());
  std::vector<double> q = start.q, u(q.size()), change(q.size());
  for (std::size_t h = 0; h < simulation.model().hands.size(); ++h) {
    const control::HandAxes axes = control::hand_axes(simulation.model(), simulation.model().hands[h]);
    std::vector<double> row(axes.axes.size());
    simulation.scene().control->hands[h].trajectory.at(0, row);
    for (std::size_t i = 0; i < row.size(); ++i) q[axes.axes[i].dof] = row[i];
  }
  model::place_joints(simulation.model(), q, u, start);
  simulation.reset(start);
  for (long i = 0; i < simulation.step_count(); ++i) simulation.step();
  double squares = 0;
  const auto figures = simulation.figures<Tracking>();
  for (const AxisTracking& axis : figures) squares += axis.rms_error * axis.rms_error;
  return std::sqrt(squares / static_cast<double>(figures.size())) / kDegree;
}

// Oracle: the targets; the bounds are the goal and the error that the goal starts from.
TEST(FeedForward, FollowsARecordedMotionWithoutLag) {
  const double before = tracking_error("implicit"), after = tracking_error("feed_forward");
  EXPECT_GT(before, 2);
  EXPECT_LT(after, 0.3);
}

std::vector<std::vector<std::string>> rows_of(const std::filesystem::path& path, char separator = ',') {
  std::ifstream in(path);
  std::vector<std::vector<std::string>> out;
  for (std::string line; std::getline(in, line);) {
    std::vector<std::string>& row = out.emplace_back();
    std::stringstream fields(line);
    for (std::string field; std::getline(fields, field, separator);) row.push_back(field);
  }
  return out;
}

std::size_t column_of(const std::vector<std::vector<std::string>>& rows, const std::string& name) {
  for (std::size_t i = 0; i < rows[0].size(); ++i)
    if (rows[0][i] == name) return i;
  ADD_FAILURE() << name;
  return 0;
}

// Oracle: the state of the same run in memory, and its continuation: a state rebuilt from a row of bodies.csv
// runs on as the run did. ODE keeps nothing else without contacts.
TEST(RecordedTables, BodiesRebuildAState) {
  const test::TemporaryFolder folder;
  RunOptions options;
  options.out = folder.path();
  const scene::Scene scene =
      test::shipped_scene("dropped_hand", {"duration=0.1 s", "record={every: 10 ms, bodies: true}"});
  run(scene, options);
  const auto rows = rows_of(folder.path() / "bodies.csv");
  ASSERT_EQ(rows.size(), 12U);
  const auto state_of = [&](const std::vector<std::string>& row) {
    model::State state = model::initial_state(scene.model);
    state.time = std::stod(row[0]);
    for (std::size_t b = 1; b < state.bodies.size(); ++b) {
      const auto value = [&](std::size_t i) { return std::stod(row[1 + 13 * (b - 1) + i]); };
      state.bodies[b] = {{value(0), value(1), value(2)},
                         Quat(value(3), value(4), value(5), value(6)),
                         {value(7), value(8), value(9)},
                         {value(10), value(11), value(12)}};
    }
    return state;
  };
  EXPECT_EQ(rows[0][column_of(rows, scene.model.bodies[1].name + ".vx[m/s]")],
            scene.model.bodies[1].name + ".vx[m/s]");
  Simulation again(scene, no_watchers);
  again.reset(state_of(rows[6]));
  for (int i = 0; i < 50; ++i) again.step();
  const model::State expected = state_of(rows[11]);
  for (std::size_t b = 1; b < expected.bodies.size(); ++b)
    EXPECT_LT((again.state().bodies[b].p - expected.bodies[b].p).norm(), 1e-9) << scene.model.bodies[b].name;
}

// Oracle: statics of a hand at rest: each joint carries the weight of what is beyond it, and the hand's
// momentum is 0.
TEST(RecordedTables, ReactionsCarryTheWeightAtRest) {
  const test::TemporaryFolder folder;
  RunOptions options;
  options.out = folder.path();
  const scene::Scene scene =
      test::shipped_scene("every_pose", {"criteria={}", "duration=1 s",
                                         "control.poses.programs.every_pose.keys=[{time: 0, pose: rest}]",
                                         "record={every: 0.1 s, reactions: true, momentum: true}"});
  run(scene, options);
  const auto rows = rows_of(folder.path() / "reactions.csv"),
             momenta = rows_of(folder.path() / "momentum.csv");
  ASSERT_EQ(rows.size(), 11U);  // none at the start, before the first step
  double weight = 0;
  for (const model::Body& body : scene.model.bodies)
    if (body.name.starts_with("right.index")) weight += 9.80665 * body.mass;
  EXPECT_NEAR(std::stod(rows.back()[column_of(rows, "right.index_mcp.fz[N]")]), weight, 1e-3 * weight);
  EXPECT_NEAR(std::stod(rows.back()[column_of(rows, "right.index_mcp.fx[N]")]), 0, 1e-3 * weight);
  EXPECT_NEAR(std::stod(momenta.back()[column_of(momenta, "left.pz[kg_m/s]")]), 0, 1e-6);
}

// Oracle: the keypoints' own places: the tip lies beyond the joint by the length of its segment.
TEST(RecordedTables, MarkersAreJointCentresAndFingertips) {
  const test::TemporaryFolder folder;
  RunOptions options;
  options.out = folder.path();
  const scene::Scene scene =
      test::shipped_scene("two_hands", {"duration=0.05 s", "record={every: 10 ms, markers: true}"});
  run(scene, options);
  const auto rows = rows_of(folder.path() / "markers.csv"),
             frames = rows_of(folder.path() / "markers.trc", '\t');
  ASSERT_EQ(rows[0].size(), 1U + 2 * 21 * 3);
  EXPECT_EQ(rows[0][1], "right.wrist.x[m]");
  ASSERT_EQ(frames.size(), 6U + 6U);
  EXPECT_EQ(frames[2][2], "6");
  EXPECT_EQ(frames[3][2], "right.wrist");
  EXPECT_EQ(frames[6][2], rows[1][1]);
  const auto point = [&](const std::string& name) {
    const std::size_t c = column_of(rows, name + ".x[m]");
    return Vec3(std::stod(rows[1][c]), std::stod(rows[1][c + 1]), std::stod(rows[1][c + 2]));
  };
  const double hand_length = scene.hands[0].size.length;
  for (const std::string& side : {std::string("right."), std::string("left.")}) {
    EXPECT_NEAR((point(side + "index_tip") - point(side + "index_dip")).norm(), 0.097 * hand_length, 1e-9);
    EXPECT_NEAR((point(side + "wrist") - point(side + "middle_mcp")).norm(), 0.446 * hand_length, 1e-9);
  }
}

// What is not asked for is not written, and asking changes nothing of the motion.
TEST(RecordedTables, AreWrittenOnRequestOnlyAndLeaveTheMotionAsItIs) {
  std::vector<std::uint64_t> hashes;
  for (const char* record :
       {"record={every: 10 ms}",
        "record={every: 10 ms, bodies: true, markers: true, momentum: true, reactions: true}"}) {
    const test::TemporaryFolder folder;
    RunOptions options;
    options.out = folder.path();
    hashes.push_back(run(test::shipped_scene("two_hands", {"duration=0.2 s", record}), options).state_hash);
    for (const std::string& name : extra_table_files())
      EXPECT_EQ(std::filesystem::exists(folder.path() / name), hashes.size() == 2) << name;
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

}  // namespace
}  // namespace handsim::simulation
