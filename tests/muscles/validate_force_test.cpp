#include <fstream>

#include <gtest/gtest.h>

#include "handsim/study/validate/validate.h"
#include "scene_files.h"

namespace handsim::study {
namespace {

/// Writes rows of the median man to a file. @param rows `kind: ...` without name, source, measured and spread
ValidateSpec load(const test::TemporaryFolder& folder, const std::vector<std::string>& rows,
                  const std::string& end = "measured: 1, spread: 1, source: s") {
  const auto file = folder.path() / "own.yaml";
  std::ofstream out(file);
  out << "hand: " << test::source("handmodels/anatomical.yaml").string()
      << "\npeople: {man: " << test::source("config/persons/median_man.yaml").string()
      << "}\nmeasurements:\n";
  for (std::size_t i = 0; i < rows.size(); ++i)
    out << "  - {name: row" << i << ", person: man, " << rows[i] << ", " << end << "}\n";
  out.close();
  return load_validate(file);
}

std::vector<double> ours(const ValidateSpec& spec) {
  std::vector<double> out;
  for (const ValidateRow& row : run_validate(spec).rows) out.push_back(row.ours);
  return out;
}

std::string problems(const std::vector<std::string>& rows) {
  const test::TemporaryFolder folder;
  try {
    load(folder, rows);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

std::string thumb(double ip) {
  return "kind: tip_force, finger: thumb, segment: thumb_proximal, direction: dorsal, pose: "
         "{thumb_mcp.flexion: 15 deg, "
         "thumb_ip.flexion: " +
         std::to_string(ip) + " deg}";
}

// A force at the proximal phalanx has no moment about the IP, which the long extensor turns. Oracle: on its
// stop at -15 deg the joint takes that moment, so that the force grows by more than half; it stays below what
// the extensors' moment about the MCP gives at half the phalanx, 18.9 mm.
TEST(Validate, AStopTakesTheMomentThatAForceDoesNotNeed) {
  const test::TemporaryFolder folder;
  const auto found = ours(load(
      folder, {thumb(-14), thumb(-15),
               "kind: joint_moment, axis: thumb_mcp.flexion, direction: negative, muscles: [EPL, EPB], pose: "
               "{thumb_mcp.flexion: 15 deg, thumb_ip.flexion: -15 deg}"}));
  EXPECT_GT(found[1], 1.5 * found[0]);
  EXPECT_LT(found[1], 1.02 * found[2] / 0.0179);
}

// Oracle: the four directions that Li & Harkness 2004 measured have the order flexion, then extension and
// adduction, then abduction.
TEST(Validate, TheThumbPressesInAllDirections) {
  const test::TemporaryFolder folder;
  std::vector<std::string> rows;
  for (const char* direction : {"palmar", "dorsal", "ulnar", "radial"})
    rows.push_back(std::string("kind: tip_force, finger: thumb, segment: thumb_proximal, direction: ") +
                   direction + ", pose: {thumb_mcp.flexion: 15 deg, thumb_ip.flexion: -15 deg}");
  const auto found = ours(load(folder, rows));
  EXPECT_GT(found[0], std::max(found[1], found[2]));
  EXPECT_LT(found[3], std::min(found[1], found[2]));
}

// Oracle: the whole share on one finger is the force of that finger; balancing an axis never helps; one pose
// over itself is 1.
TEST(Validate, AGripOfOneFingerIsThatFingersForce) {
  const test::TemporaryFolder folder;
  const std::string pose =
      "pose: {index_mcp.flexion: 50 deg, index_pip.flexion: 60 deg, index_dip.flexion: 40 deg}";
  const auto found = ours(load(
      folder,
      {"kind: tip_force, finger: index, segment: index_distal, direction: palmar, " + pose,
       "kind: grip_force, shares: {index_distal: 1}, " + pose,
       "kind: grip_force, shares: {index_distal: 1}, balanced: [wrist.flexion, wrist.deviation], " + pose,
       "kind: grip_force, shares: {index_middle: 0.5, index_distal: 0.5}, over_" + pose + ", " + pose}));
  EXPECT_NEAR(found[1], found[0], 1e-3 * found[0]);
  EXPECT_LE(found[2], found[1] * 1.001);
  EXPECT_NEAR(found[3], 1, 1e-9);
}

// Oracle: without others to balance, a moment is at most the sum of what turns the axis that way (1 % may be
// missing); less where others count.
TEST(Validate, ABalancedMomentIsLessThanTheSumOfTheMuscles) {
  const test::TemporaryFolder folder;
  const std::string kind = "kind: joint_moment, axis: wrist.deviation, direction: negative, ";
  const auto found =
      ours(load(folder, {kind + "muscles: [FCU, ECU, EDM, EDC4, EDC5, EIP, EDC3, EDC2, FCR, PL, ECRB, ECRL]",
                         kind + "balanced: [wrist.flexion]"}));
  EXPECT_LT(found[1], 1.02 * found[0] + 0.3);
  EXPECT_GT(found[1], 0.5 * found[0]);
}

// Oracle: people's fingers close as the wrist extends (tenodesis), by 36 deg at the MCP over 120 deg of the
// wrist.
TEST(Validate, FingersAtRestCloseAsTheWristExtends) {
  const test::TemporaryFolder folder;
  std::vector<std::string> rows;
  for (const char* wrist : {"60", "-60"})
    rows.push_back(
        std::string("kind: coupled_angle, axis: middle_mcp.flexion, finger: middle, pose: {wrist.flexion: ") +
        wrist + " deg}");
  const auto found = ours(load(folder, rows, "measured: 1 deg, spread: 1 deg, source: s"));
  EXPECT_GT(found[1] - found[0], 20 * M_PI / 180);
  EXPECT_LT(found[1] - found[0], 60 * M_PI / 180);
}

// Oracle: the two rows: one holds and is no prediction, the other is one and does not hold.
TEST(Validate, PredictionsCountApart) {
  const test::TemporaryFolder folder;
  const ValidateSpec spec = load(folder,
                                 {"kind: hand_mass, predicted: true, spread: 0.1, measured: 5",
                                  "kind: hand_mass, spread: 10, measured: 0.4"},
                                 "source: s");
  const ValidateResult result = run_validate(spec);
  EXPECT_EQ(result.share, 1);
  EXPECT_EQ(result.predicted, 0);
  const std::string table = validate_table(spec, result);
  EXPECT_NE(table.find("0 % of 1 predictions"), std::string::npos) << table;
  EXPECT_LT(table.find("row1"), table.find("predictions, to which")) << table;
}

TEST(Validate, NamesWhatAGripCannotHave) {
  const std::string text = problems({"kind: grip_force, shares: {index_distal: 0.5, middle_dstal: 0.5}",
                                     "kind: grip_force, shares: {index_distal: 0.5, middle_distal: 0.4}",
                                     "kind: joint_moment, axis: wrist.flexion, direction: positive, muscles: "
                                     "[FCR], balanced: [wrist.deviaton]",
                                     "kind: excursion, muscles: [FCR], over_pose: {wrist.flexion: 10 deg}"});
  for (const char* part : {"middle_dstal", "middle_distal", "a sum of 0.9", "muscles beside balanced axes",
                           "wrist.deviation", "over_pose"})
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
}

}  // namespace
}  // namespace handsim::study
