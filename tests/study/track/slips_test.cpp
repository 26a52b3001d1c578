// Recordings that a newcomer gets wrong: units, names, times, sides.
#include <gtest/gtest.h>

#include "study/track/synthetic_recording.h"
#include "support/sanitized.h"

namespace handsim::study {
namespace {

using test::MovingHand;

struct Slip {
  TrackInput input = test::shipped_input();
  Recording recording;

  explicit Slip(model::Side side = model::Side::right, const std::string& name = "right") {
    std::mt19937 random(5);
    MovingHand truth(input, input.person, side);
    recording.file = "slip.csv";
    recording.times = test::frame_times(40, 50);
    truth.record(name, 0, random, recording);
  }
  void scale(double factor) {
    for (auto& [name, channel] : recording.channels)
      for (Vec3& point : channel.points.values()) point *= factor;
  }
  std::string refusal() const {
    try {
      run_track(input, recording);
      return "";
    } catch (const Error& error) {
      return error.what();
    }
  }
};

void expect_part(const std::string& text, const std::string& part) {
  EXPECT_NE(text.find(part), std::string::npos) << text;
}

// Oracle: what was done to the recording.
TEST(TrackSlips, OtherUnitsAreNamed) {
  for (const double factor : {1000.0, 0.001}) {
    Slip slip;
    slip.scale(factor);
    expect_part(slip.refusal(), "slip.csv: got points of one hand up to ");
    expect_part(slip.refusal(), "the unit is in");
  }
}

TEST(TrackSlips, NamesThatNoHandUsesAreNamedWithTheNearest) {
  Slip slip;
  slip.recording.channels["right.indx_tip"] = slip.recording.channels["right.index_tip"];
  slip.recording.channels.erase("right.index_tip");
  const TrackResult result = run_track(slip.input, slip.recording);
  ASSERT_EQ(result.warnings.size(), 1U);
  expect_part(result.warnings[0], "right.indx_tip (nearest: right.index_tip)");
  EXPECT_EQ(result.hands.at(0).count(FrameStatus::tracked), 40U);
}

TEST(TrackSlips, ARecordingWithoutAnyKnownNameIsRefused) {
  Slip slip;
  std::map<std::string, Channel> bare;
  for (const auto& [name, channel] : slip.recording.channels) bare[name.substr(6)] = channel;
  slip.recording.channels = bare;
  expect_part(slip.refusal(), "no point of a hand, but index_dip");
}

TEST(TrackSlips, MillisecondsAreSuspected) {
  Slip slip;
  for (double& time : slip.recording.times) time *= 1000;
  const TrackResult result = run_track(slip.input, slip.recording);
  ASSERT_EQ(result.warnings.size(), 1U);
  expect_part(result.warnings[0], "frames 20 s apart: times in milliseconds?");
}

TEST(TrackSlips, ALeftHandUnderTheNameOfTheRightIsSaidToBeOne) {
  HANDSIM_SKIP_WITH_SANITIZER("Track.AHandUnderTheNameOfTheOtherIsMarkedByItsShape has such a hand, too");
  const Slip slip(model::Side::left, "right");
  const TrackResult result = run_track(slip.input, slip.recording);
  EXPECT_EQ(result.hands.at(0).count(FrameStatus::swapped), 40U);
  ASSERT_EQ(result.warnings.size(), 1U);
  expect_part(result.warnings[0], "it is a left hand under the wrong name");
}

TEST(TrackSlips, ASoundRecordingHasNoWarning) {
  const Slip slip;
  EXPECT_TRUE(run_track(slip.input, slip.recording).warnings.empty());
}

}  // namespace
}  // namespace handsim::study
