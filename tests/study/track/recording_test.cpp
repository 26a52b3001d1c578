#include "handsim/study/track/recording.h"

#include <gtest/gtest.h>

#include <fstream>

#include "handsim/study/track/marker_set.h"
#include "scene_files.h"
#include "support/peak_memory.h"

namespace handsim::study {
namespace {

Recording read_text(const std::string& name, const std::string& text) {
  const test::TemporaryFolder folder;
  std::ofstream(folder.path() / name) << text;
  return read_recording(folder.path() / name);
}

std::string refusal(const std::string& name, const std::string& text) {
  try {
    read_text(name, text);
    return "";
  } catch (const Error& error) {
    return error.problems().front().text();
  }
}

TEST(Recording, ReadsCsvWithUnitsNumbersOfKeypointsAndGaps) {
  const Recording read = read_text("a.csv",
                                   "time[s],right.8.x[mm],right.8.y[mm],right.8.z[mm],s.qw,s.qx,s.qy,s.qz\n"
                                   "0,1,2,3,1,0,0,0\n0.5,,nan,3,0,0,1,0\n");
  EXPECT_EQ(read.times, (std::vector<double>{0, 0.5}));
  const Channel& tip = read.channels.at("right.index_tip");
  EXPECT_LT((*tip.points.at(0) - Vec3(0.001, 0.002, 0.003)).norm(), 1e-18);
  EXPECT_FALSE(tip.points.at(1));
  EXPECT_EQ(read.channels.at("s").orientations.at(1)->y(), 1);
}

// Oracle: the same file with tabs.
TEST(Recording, ATrcThatASpreadsheetHasSavedIsReadAsWithTabs) {
  std::string text =
      "PathFileType\t4\t(X/Y/"
      "Z)\ta.trc\t\t\nDataRate\tNumFrames\tNumMarkers\tUnits\t\t\t\n100\t2\t1\tmm\t\t\t\n"
      "Frame#\tTime\tA\t\t\n\t\tX1\tY1\tZ1\n\t\t\t\t\n1\t0\t1\t2\t3\n2\t0.5\t\t\t\n";
  const Recording tabs = read_text("a.trc", text);
  std::ranges::replace(text, '\t', ',');
  const Recording commas = read_text("a.trc", text);
  EXPECT_EQ(commas.times, (std::vector<double>{0, 0.5}));
  EXPECT_EQ(commas.times, tabs.times);
  EXPECT_EQ(*commas.channels.at("A").points.at(0), *tabs.channels.at("A").points.at(0));
  EXPECT_FALSE(commas.channels.at("A").points.at(1));
}

TEST(Recording, MayBeginWithAByteOrderMark) {
  const std::string text = "time[s],right.8.x[mm],right.8.y[mm],right.8.z[mm]\n0,1,2,3\n";
  EXPECT_EQ(*read_text("a.csv", "\xef\xbb\xbf" + text).channels.at("right.index_tip").points.at(0),
            *read_text("a.csv", text).channels.at("right.index_tip").points.at(0));
}

TEST(Recording, ReadsJsonOfACameraTracker) {
  std::string points, objects;
  for (int i = 0; i < 21; ++i) {
    points += (i > 0 ? "," : "") + std::string(i == 5 ? "null" : "[" + std::to_string(i) + ",2,3]");
    objects += (i > 0 ? "," : "") + std::string("{\"x\":1,\"y\":2,\"z\":") + std::to_string(i) + "}";
  }
  const Recording read = read_text("a.json",
                                   "{\"rate\": 50, \"unit\": \"mm\", \"frames\": [{\"hands\": [{\"side\": "
                                   "\"Right\", \"points\": [" +
                                       points +
                                       "]}]}, {\"hands\": []}, {\"hands\": "
                                       "[{\"side\": \"left\", \"points\": [" +
                                       objects + "]}]}]}");
  EXPECT_EQ(read.times, (std::vector<double>{0, 0.02, 0.04}));
  EXPECT_LT((*read.channels.at("right.little_tip").points.at(0) - Vec3(0.02, 0.002, 0.003)).norm(), 1e-18);
  EXPECT_FALSE(read.channels.contains("right.index_mcp"));
  EXPECT_FALSE(read.channels.at("right.wrist").points.at(1));
  EXPECT_LT((*read.channels.at("left.thumb_cmc").points.at(2) - Vec3(0.001, 0.002, 0.001)).norm(), 1e-18);
}

// Oracle: the same file with the names of conventions.
TEST(Recording, ReadsNamesAsTrackersWriteThem) {
  for (const char* name :
       {"index_tip", "INDEX_FINGER_TIP", "XR_HAND_JOINT_INDEX_TIP_EXT", "index-finger-tip"}) {
    const std::string column = std::string("right.") + name;
    const Recording read =
        read_text("a.csv", "time[s]," + column + ".x[m]," + column + ".y[m]," + column + ".z[m]\n0,1,2,3\n");
    EXPECT_EQ(*read.channels.at("right.index_tip").points.at(0), Vec3(1, 2, 3)) << name;
    const Recording json = read_text(
        "a.json", std::string(R"({"rate": 1, "frames": [{"hands": [{"side": "right", "points": {")") + name +
                      R"(": [1, 2, 3]}}]}]})");
    EXPECT_EQ(*json.channels.at("right.index_tip").points.at(0), Vec3(1, 2, 3)) << name;
  }
  EXPECT_EQ(plain_name("PINKY_MCP"), "little_mcp");
  EXPECT_EQ(plain_name("pinky-finger-phalanx-intermediate"), "little_intermediate");
}

// Oracle: null in the place of NaN, which Python writes, and the place of what is wrong behind it.
TEST(Recording, TakesNanInJsonForAPointThatWasNotSeen) {
  const std::string head = R"({"rate": 1, "frames": [{"hands": [{"side": "right", "points": {"wrist": )";
  const Recording read =
      read_text("a.json", head + R"([NaN, 2, 3], "index_tip": NaN, "little_tip": [1, 2, 3]}}]}]})");
  EXPECT_FALSE(read.channels.contains("right.wrist"));
  EXPECT_FALSE(read.channels.contains("right.index_tip"));
  EXPECT_TRUE(read.channels.at("right.little_tip").points.at(0));
  const auto place = [](const std::string& value) {
    const std::string text = refusal("a.json", "{\"a\": " + value + ", \"frames\": [], \"frames\": []}");
    return text.substr(text.find("a.json:"));
  };
  EXPECT_EQ(place("NaN"), place("111"));
}

// Oracle: the limit of the format; a confidence of the hand is that of its points without one.
TEST(Recording, APointOfLowConfidenceWasNotSeen) {
  const Recording csv = read_text("a.csv",
                                  "time[s],right.a.x[m],right.a.y[m],right.a.z[m],right.a.confidence\n"
                                  "0,1,2,3,0.4\n1,1,2,3,0.6\n2,1,2,3,\n3,1,2,3,-1\n");
  const Seen<Vec3>& of = csv.channels.at("right.a").points;
  EXPECT_FALSE(of.at(0));
  EXPECT_TRUE(of.at(1));
  EXPECT_EQ(*csv.channels.at("right.a").confidences.at(1), 0.6);
  EXPECT_TRUE(of.at(2));
  EXPECT_FALSE(of.at(3));
  ASSERT_EQ(csv.warnings.size(), 1U);
  EXPECT_NE(csv.warnings[0].find("2 of 3 points have a confidence below 0.5"), std::string::npos)
      << csv.warnings[0];

  const test::TemporaryFolder folder;
  std::ofstream(folder.path() / "a.json") << R"({"rate": 1, "frames": [
    {"hands": [{"side": "right", "score": 0.9, "points": {"wrist": {"x": 1, "y": 2, "z": 3}, "index_tip": {"x": 1, "y": 2, "z": 3, "score": 0.2}}}]},
    {"hands": [{"side": "right", "score": 0.3, "points": {"wrist": [1, 2, 3]}}]}]})";
  RecordingFormat format;
  format.confidence = "score";
  format.least_confidence = 0.35;
  const Recording json = read_recording(folder.path() / "a.json", format);
  EXPECT_EQ(*json.channels.at("right.wrist").confidences.at(0), 0.9);
  EXPECT_TRUE(json.channels.at("right.wrist").points.at(0));
  EXPECT_FALSE(json.channels.at("right.wrist").points.at(1));
  EXPECT_TRUE(json.channels.at("right.index_tip").points.empty());
  // A tracker that writes 0 everywhere does not state it.
  const Recording zeros =
      read_text("a.csv", "time[s],right.a.x[m],right.a.y[m],right.a.z[m],right.confidence\n0,1,2,3,0\n");
  EXPECT_TRUE(zeros.channels.at("right.a").points.at(0));
  EXPECT_NE(zeros.warnings.at(0).find("every confidence is 0"), std::string::npos);
  EXPECT_NE(refusal("a.csv", "time[s],a.x[m],a.y[m],a.z[m],a.confidence\n0,1,2,3,87\n")
                .find("a.csv:2:1: a: got a confidence of 87"),
            std::string::npos);
}

TEST(Recording, ReadsMarkersOfATrc) {
  const Recording read = read_text(
      "a.trc",
      "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\t"
      "OrigDataStartFrame\tOrigNumFrames\n100\t100\t2\t2\tmm\t100\t1\t2\nFrame#\tTime\tA\t\t\tB\t\t\n"
      "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n1\t0\t1\t2\t3\t4\t5\t6\n2\t0.01\t1\t2\t3\t\t\t\n");
  EXPECT_LT((*read.channels.at("B").points.at(0) - Vec3(0.004, 0.005, 0.006)).norm(), 1e-18);
  EXPECT_FALSE(read.channels.at("B").points.at(1));
  EXPECT_TRUE(read.channels.at("A").points.at(1));
}

TEST(Recording, RefusesWhatItCannotReadWithItsPlace) {
  const auto expect = [](const std::string& text, const std::string& part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  expect(refusal("a.csv", "time[s],a.x[m],a.y[m]\n"), "x, y and z");
  expect(refusal("a.csv", "time[s],a.x[m],a.y[m],a.z[m]\n1,0,0,0\n1,0,0,0\n"), "a.csv:3:1");
  expect(refusal("a.csv", "time[s],a.x[m],a.y[m],a.z[m]\n1,0,zero,0\n"), "\"zero\"");
  expect(refusal("a.csv", "time[s],a.qw,a.qx,a.qy,a.qz\n1,1,1,0,0\n"), "a quaternion of length 1.414");
  expect(refusal("a.json", "{\"frames\": [{\"hands\": []}]}"), "no time");
  expect(
      refusal("a.json", "{\"frames\": [{\"time\": 0, \"hands\": [{\"side\": \"right\", \"points\": []}]}]}"),
      "21 points");
  expect(refusal("a.json", "{"), "JSON");
  expect(refusal("a.csv", "time[s],a.x[m],a.y[m],a.z[m]\n1,0,0,0\n1.0000001,0,0,0\n"), "a.csv:3:1: time");
  expect(refusal("a.csv", "time[s],a.x[m],a.y[m],a.z[m]\n1,0,0,0\n2e5,0,0,0\n"), "at most 100000 s");
  expect(refusal("a.csv", "time[s],a.x[m],a.y[m],a.z[m]\n1,0,1e300,0\n"),
         "a.csv:2:1: a: got a point 1e+300 m");
  expect(refusal("a.trc", "PathFileType\n"), "five lines");
  expect(refusal("a.mot", "x"), ".csv, .json, .trc or .c3d");
}

std::string trc(const std::string& frames, const std::string& markers, const std::string& rows) {
  return "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tNumFrames\tNumMarkers\tUnits\n100\t" + frames + "\t" +
         markers + "\tmm\nFrame#\tTime\tA\t\t\tB\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n" + rows;
}

// Oracle: the numbers in the head of the file.
TEST(Recording, RefusesACutTrc) {
  const std::string row = "1\t0\t1\t2\t3\t4\t5\t6\n";
  EXPECT_EQ(refusal("a.trc", trc("1", "2", row)), "");
  EXPECT_EQ(refusal("a.trc", trc("1", "2", "1\t0\t1\t2\t3\n")), "");
  const std::vector<std::pair<std::string, std::string>> cut = {
      {trc("51", "2", row), "a.trc:6:1: NumFrames: got 1, need 51"},
      {trc("1", "3", row), "NumMarkers: got 2, need 3"},
      {trc("1", "2", "1\t0\t1\t2\t3\t4\t5\n"), "a.trc:6:1: got 7 values, need 8"},
      {trc("1", "2", "1\t0\t1\t2\t3"), "a.trc:6:1: got 5 values, need 8"},
      {trc("many", "2", row), "NumFrames: got 1, need many"}};
  for (const auto& [text, problem] : cut)
    EXPECT_NE(refusal("a.trc", text).find(problem), std::string::npos) << refusal("a.trc", text);
}

std::string hand(const std::string& side, const std::string& point = "[0,0,1]") {
  std::string points = point;
  for (int i = 1; i < 21; ++i) points += ",[0,0,0]";
  return R"({"side": ")" + side + R"(", "points": [)" + points + "]}";
}

// Oracle: the place at which each text was spoilt.
TEST(Recording, RefusesSpoiltJsonWithItsPlace) {
  const auto frames = [](const std::string& head, const std::string& hands) {
    return "{" + head +
           R"("frames": [)"
           "\n"
           R"({"hands": []},)"
           "\n"
           R"({"hands": [)" +
           hands + "]}]}";
  };
  const std::vector<std::pair<std::string, std::string>> spoilt = {
      {frames(R"("rate": 1e308, )", ""), "a.json:1:1: rate: got 1e+308, need a rate above 0 to 1e6 Hz"},
      {frames(R"("rate": 0, )", ""), "no time in 2 of 2 frames"},
      {frames(R"("rate": "60", )", ""), "type must be number"},
      {R"({"rate": 1, "frames": [], "frames": []})", "a.json:1:35: frames: got a second list"},
      {frames(R"("unit": "inch", )", ""), "unit: got inch, need m, cm or mm"},
      {frames("", ""), "no time in 2 of 2 frames"},
      {frames(R"("rate": 1, )", R"({"side": "both"})"), "a.json:3:"},
      {frames(R"("rate": 1, )", R"({"side": "both"})"), "frames.1: got the side both, need right or left"},
      {frames(R"("rate": 1, )", R"({"side": "left"})"),
       "frames.1: got [json.exception.out_of_range.403] key 'points' not found"},
      {frames(R"("rate": 1, )", R"({"points": []})"), "key 'side' not found"},
      {frames(R"("rate": 1, )", "7"), "frames.1: got [json.exception"},
      {frames(R"("rate": 1, )", hand("left", "[1,2]")),
       "frames.1: got [json.exception.out_of_range.401] array index 2"},
      {frames(R"("rate": 1, )", hand("left", "[1,[],2]")), "type must be number, but is array"},
      {frames(R"("rate": 1, )", hand("left", "\"x\"")), "cannot use at() with string"},
      {frames(R"("rate": 1, )", hand("left", "[1,true,2]")), "type must be number, but is boolean"},
      {frames(R"("rate": 1, )", hand("left", "[1e4,0,0]")), "frames.1: left.wrist: got a point 1e+04 m away"},
      {R"({"rate": 1, "frames": {}})", "no frames"},
      {R"({"rate": 1})", "no frames"},
      {R"({"rate": 1, "frames": [{}]})",
       "frames.0: got [json.exception.out_of_range.403] key 'hands' not found"},
      {R"([{"time": 0, "hands": []}, {"hands": []}])", "no time in 1 of 2 frames"},
      {R"([{"time": 0, "hands": []}, {"time": 0, "hands": []}])", "time: got 0 s after 0 s"},
      {"[1e999]", "JSON with"},
      {"[", "JSON with"},
      {"", "JSON with"}};
  for (const auto& [text, problem] : spoilt)
    EXPECT_NE(refusal("a.json", text).find(problem), std::string::npos) << text << "\n"
                                                                        << refusal("a.json", text);
}

// Oracle: one of the hands was labelled wrongly, and nobody knows which.
TEST(Recording, TwoRightHandsInAFrameAreNamedAndNotUsed) {
  const Recording read = read_text("a.json", R"({"frames": [{"hands": [)" + hand("right") + "]}, " +
                                                 R"({"hands": [)" + hand("right") + "," + hand("Right") +
                                                 "," + hand("left") + R"(]}], "rate": 10})");
  EXPECT_TRUE(read.channels.at("right.wrist").points.at(0));
  EXPECT_FALSE(read.channels.at("right.wrist").points.at(1));
  EXPECT_TRUE(read.channels.at("left.wrist").points.at(1));
  ASSERT_EQ(read.warnings.size(), 1U);
  EXPECT_NE(read.warnings[0].find("1 frames have two hands of one side, the first of them frames.1"),
            std::string::npos);
}

// Memory of what is read and tracked stays below 20 times the file. The bound has room: a frame without a
// hand takes 8 bytes of its 13, a point that was seen 28 of some 20.
TEST(Recording, TakesLittleMemory) {
  const double before = test::peak_memory();
  const test::TemporaryFolder folder;
  std::string text =
      R"({"rate": 100, "unit": "mm", "frames": [)" + std::string("{\"hands\": [") + hand("left") + "]}";
  for (int k = 0; k < 400'000; ++k)
    text += k % 80 == 0 ? ",\n{\"hands\": [" + hand("right") + "]}" : ",{\"hands\":[]}";
  text += "]}";
  std::ofstream(folder.path() / "a.json") << text;
  const auto size = static_cast<double>(text.size());
  const Recording read = read_recording(folder.path() / "a.json");
  EXPECT_EQ(read.times.size(), 400'001U);
  EXPECT_EQ(read.channels.at("right.wrist").points.frames().size(), 5'000U);
  EXPECT_LT(test::peak_memory() - before, 8 * size);
}

TEST(MarkerSet, NamesSegmentsOfTheHandModel) {
  Diagnostics diagnostics;
  YamlNode root = parse_yaml(
      "markers: [{name: A, segment: index_proximal, at: [0, 20 mm, 8 mm]}]\n"
      "sensors: [{name: S, hand: left, segment: palm}]\n",
      "set.yaml");
  const MarkerSet set = read_marker_set(root, "", diagnostics);
  EXPECT_TRUE(diagnostics.problems.empty());
  YamlNode model = load_yaml(test::source("handmodels/anatomical.yaml"));
  const hand::HandSpec spec = hand::read_hand_spec(model, "", diagnostics);
  const std::vector<Feature> right = features_of(set, spec, model::Side::right);
  ASSERT_EQ(right.size(), 1U);
  EXPECT_EQ(spec.segments[right[0].segment.value()].name, "index_proximal");
  EXPECT_FALSE(features_of(set, spec, model::Side::left).at(0).segment);
  YamlNode wrong = parse_yaml("markers: [{name: A, segment: index_proximl, at: [0, 0, 0]}]\n", "set.yaml");
  const MarkerSet misspelt = read_marker_set(wrong, "", diagnostics);
  EXPECT_THROW(features_of(misspelt, spec, model::Side::right), Error);
}

}  // namespace
}  // namespace handsim::study
