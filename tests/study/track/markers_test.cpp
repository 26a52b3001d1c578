#include <gtest/gtest.h>

#include <algorithm>

#include "study/track/synthetic_recording.h"
#include "support/sanitized.h"

namespace handsim::study {
namespace {

using test::MovingHand;

/// Three markers on the palm and two on every segment, on the skin beside the bone.
MarkerSet marker_set(const hand::HandSpec& spec, model::Side side) {
  MarkerSet out;
  const auto add = [&](const std::string& segment, const Vec3& at) {
    MarkerSpec marker;
    marker.name = std::string(side == model::Side::right ? "R" : "L") + std::to_string(out.markers.size());
    marker.hand = side;
    marker.segment = segment;
    marker.at = at;
    out.markers.push_back(marker);
  };
  add("palm", {0.02, 0.01, 0.012});
  add("palm", {-0.02, 0.015, 0.012});
  add("palm", {0.005, 0.06, 0.015});
  for (const hand::SegmentSpec& segment : spec.segments) {
    add(segment.name, {0.004, 0.006, 0.009});
    add(segment.name, {-0.003, 0.015, 0.008});
  }
  return out;
}

hand::Person other_hand(const hand::Person& person) {
  hand::Person out = person;
  out.hand_length = 0.176;
  out.hand_breadth = 0.082;
  out.bones["index_proximal"] = 0.041;
  out.bones["little_middle"] = 0.021;
  return out;
}

/// A recording of the markers on a hand of another size than that of the input.
Recording record(const TrackInput& input, MovingHand& truth, model::Side side, double noise) {
  std::mt19937 random(11);
  Recording out;
  out.file = "markers.trc";
  out.times = test::frame_times(150, 60);
  truth.features = features_of(*input.markers, input.model, side);
  truth.record("", noise, random, out);
  // record() puts the side before the names.
  std::map<std::string, Channel> named;
  for (auto& [name, channel] : out.channels) named[name.substr(1)] = std::move(channel);
  out.channels = std::move(named);
  return out;
}

// Oracle: the sizes and angles from which the places of the markers were computed.
TEST(Markers, ExactOnesGiveSizesAndAnglesBack) {
  for (const model::Side side : {model::Side::right, model::Side::left}) {
    TrackInput input = test::shipped_input();
    input.markers = marker_set(input.model, side);
    const hand::Person person = other_hand(input.person);
    MovingHand truth(input, person, side);
    const TrackResult result = run_track(input, record(input, truth, side, 0));
    EXPECT_NEAR(*result.person.hand_length, *person.hand_length, 1e-6);
    EXPECT_NEAR(*result.person.hand_breadth, *person.hand_breadth, 1e-6);
    for (const auto& [bone, length] : person.bones)
      EXPECT_NEAR(result.person.bones.at(bone), length, 1e-6) << bone;
    ASSERT_EQ(result.hands.size(), 1U);
    EXPECT_EQ(result.hands[0].count(FrameStatus::tracked), 150U);
    for (std::size_t k = 0; k < result.times.size(); k += 10) {
      const HandPose expected = truth.pose(result.times[k]);
      for (std::size_t i = 0; i < expected.angles.size(); ++i)
        EXPECT_NEAR(result.hands[0].frames[k].pose.angles[i], expected.angles[i], 1e-4)
            << result.hands[0].axes[i] << " at " << result.times[k];
    }
  }
}

// Oracle: the sizes before noise of 1 mm in every coordinate was added. A size from 40 frames of several
// markers is known to some tenths of a millimetre: the bounds are five times that. Without the fit the index
// finger's proximal phalanx would be 5 mm longer.
TEST(Markers, NoisyOnesGiveSizesToAMillimetre) {
  TrackInput input = test::shipped_input();
  input.markers = marker_set(input.model, model::Side::right);
  const hand::Person person = other_hand(input.person);
  MovingHand truth(input, person, model::Side::right);
  const TrackResult result = run_track(input, record(input, truth, model::Side::right, 1e-3));
  EXPECT_NEAR(*result.person.hand_length, *person.hand_length, 2e-3);
  EXPECT_NEAR(*result.person.hand_breadth, *person.hand_breadth, 2e-3);
  for (const auto& [bone, length] : person.bones)
    EXPECT_NEAR(result.person.bones.at(bone), length, 1e-3) << bone;
  EXPECT_NEAR(result.hands.at(0).noise, 1e-3, 1e-4);
  // The markers of a last segment do not show its length: it is not invented.
  EXPECT_FALSE(result.person.bones.contains("index_distal"));
}

/// Three markers on the palm and one on each last segment: no bone is seen alone.
MarkerSet few_markers(const hand::HandSpec& spec) {
  MarkerSet out = marker_set(spec, model::Side::right);
  std::erase_if(out.markers, [&](const MarkerSpec& marker) {
    const auto segment = std::find_if(spec.segments.begin(), spec.segments.end(),
                                      [&](const auto& each) { return each.name == marker.segment; });
    return segment != spec.segments.end() && segment->has_child && marker.at.y() < 0.01;
  });
  return out;
}

// Oracle: the sizes of the recorded hand, 181 mm and 110 mm, where the input has 190 mm for want of a person,
// and the noise that was added. Before, bones that the markers do not show alone kept the length of the wrong
// person, and the rest was noise.
TEST(Markers, WithoutAPersonTheSizeComesFromTheRecording) {
  HANDSIM_SKIP_WITH_SANITIZER("tests of one recording run the same code");
  for (const double length : {0.181, 0.11})
    for (const bool many : {true, false}) {
      TrackInput input = test::shipped_input();
      input.person_named = false;
      input.markers = many ? marker_set(input.model, model::Side::right) : few_markers(input.model);
      hand::Person person = input.person;
      person.hand_breadth = 0.078 * length / 0.181;
      person.hand_length = length;
      MovingHand truth(input, person, model::Side::right);
      const TrackResult result = run_track(input, record(input, truth, model::Side::right, 5e-4));
      EXPECT_NEAR(*result.person.hand_length, length, many ? 1e-3 : 4e-3) << many;
      EXPECT_NEAR(result.hands.at(0).noise, 5e-4, 5e-5) << many;
      // 110 mm are a child's hand.
      for (const std::string& warning : result.warnings)
        EXPECT_NE(warning.find("a hand length of 110 mm is at percentile"), std::string::npos) << warning;
      EXPECT_EQ(result.warnings.size(), length < 0.15 ? 1U : 0U);
    }
}

// Oracle: three markers on the palm show no size.
TEST(Markers, ALengthThatTheyDoNotShowIsAWarning) {
  TrackInput input = test::shipped_input();
  input.person_named = false;
  input.markers = marker_set(input.model, model::Side::right);
  input.markers->markers.resize(3);
  MovingHand truth(input, input.person, model::Side::right);
  const TrackResult result = run_track(input, record(input, truth, model::Side::right, 5e-4));
  ASSERT_EQ(result.warnings.size(), 1U);
  EXPECT_NE(result.warnings[0].find("hardly show the length of the hand"), std::string::npos)
      << result.warnings[0];
  EXPECT_NEAR(result.hands.at(0).noise, 5e-4, 5e-5);
}

// Oracle: the person of the input, which `--keep-person` keeps.
TEST(Markers, LeaveThePersonAsItIsWhereAsked) {
  TrackInput input = test::shipped_input();
  input.markers = marker_set(input.model, model::Side::right);
  input.fit_bones = false;
  MovingHand truth(input, input.person, model::Side::right);
  const TrackResult result = run_track(input, record(input, truth, model::Side::right, 0));
  EXPECT_EQ(result.person.hand_length, input.person.hand_length);
  EXPECT_TRUE(result.person.bones.empty());
}

}  // namespace
}  // namespace handsim::study
