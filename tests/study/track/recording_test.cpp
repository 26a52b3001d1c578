#include "handsim/study/track/recording.h"

#include <gtest/gtest.h>

#include <fstream>

#include "handsim/study/track/marker_set.h"
#include "scene_files.h"

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
  EXPECT_LT((*tip.points[0] - Vec3(0.001, 0.002, 0.003)).norm(), 1e-18);
  EXPECT_FALSE(tip.points[1]);
  EXPECT_EQ(read.channels.at("s").orientations[1]->y(), 1);
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
  EXPECT_LT((*read.channels.at("right.little_tip").points[0] - Vec3(0.02, 0.002, 0.003)).norm(), 1e-18);
  EXPECT_FALSE(read.channels.contains("right.index_mcp"));
  EXPECT_FALSE(read.channels.at("right.wrist").points[1]);
  EXPECT_LT((*read.channels.at("left.thumb_cmc").points[2] - Vec3(0.001, 0.002, 0.001)).norm(), 1e-18);
}

TEST(Recording, ReadsMarkersOfATrc) {
  const Recording read = read_text(
      "a.trc",
      "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\t"
      "OrigDataStartFrame\tOrigNumFrames\n100\t100\t2\t2\tmm\t100\t1\t2\nFrame#\tTime\tA\t\t\tB\t\t\n"
      "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n1\t0\t1\t2\t3\t4\t5\t6\n2\t0.01\t1\t2\t3\t\t\t\n");
  EXPECT_LT((*read.channels.at("B").points[0] - Vec3(0.004, 0.005, 0.006)).norm(), 1e-18);
  EXPECT_FALSE(read.channels.at("B").points[1]);
  EXPECT_TRUE(read.channels.at("A").points[1]);
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
  expect(refusal("a.trc", "PathFileType\n"), "five lines");
  expect(refusal("a.mot", "x"), ".csv, .json or .trc");
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
  EXPECT_EQ(spec.segments[static_cast<std::size_t>(right[0].segment)].name, "index_proximal");
  EXPECT_EQ(features_of(set, spec, model::Side::left).at(0).segment, -1);
  YamlNode wrong = parse_yaml("markers: [{name: A, segment: index_proximl, at: [0, 0, 0]}]\n", "set.yaml");
  const MarkerSet misspelt = read_marker_set(wrong, "", diagnostics);
  EXPECT_THROW(features_of(misspelt, spec, model::Side::right), Error);
}

}  // namespace
}  // namespace handsim::study
