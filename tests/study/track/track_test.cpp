#include "handsim/study/track/track.h"

#include <gtest/gtest.h>

#include "study/track/synthetic_recording.h"
#include "support/peak_memory.h"
#include "support/sanitized.h"

namespace handsim::study {
namespace {

using test::MovingHand;

hand::Person other_person(const TrackInput& input) {
  hand::Person out = input.person;
  out.hand_length = 0.178;
  out.hand_breadth = 0.081;
  out.bones["index_proximal"] = 0.049;
  return out;
}

/// RMS and largest error of the angles of all tracked frames [rad].
struct AngleError {
  double rms = 0, flexion_rms = 0, largest = 0;
};

AngleError error_of(const TrackResult& result, std::size_t hand, const MovingHand& truth) {
  AngleError out;
  double count = 0, flexions = 0;
  for (std::size_t k = 0; k < result.times.size(); ++k) {
    const TrackedFrame& frame = result.hands[hand].frames[k];
    if (frame.status != FrameStatus::tracked) continue;
    const HandPose expected = truth.pose(result.times[k]);
    for (std::size_t i = 0; i < expected.angles.size(); ++i) {
      const double error = frame.pose.angles[i] - expected.angles[i];
      out.largest = std::max(out.largest, std::abs(error));
      out.rms += error * error;
      count += 1;
      const TreeAxis& axis = truth.tree.axes()[i];
      if (!axis.flexion || axis.name.starts_with("thumb")) continue;
      out.flexion_rms += error * error;
      flexions += 1;
    }
  }
  out.rms = std::sqrt(out.rms / count);
  out.flexion_rms = std::sqrt(out.flexion_rms / flexions);
  return out;
}

// Oracle: the angles from which the keypoints were computed, of a hand whose size the tracker has to find.
TEST(Track, ExactKeypointsGiveTheAnglesBack) {
  const TrackInput input = test::shipped_input();
  std::mt19937 random(1);
  for (const model::Side side : {model::Side::right, model::Side::left}) {
    const std::string name = side == model::Side::right ? "right" : "left";
    MovingHand truth(input, other_person(input), side);
    Recording recording;
    recording.times = test::frame_times(200, 50);
    truth.record(name, 0, random, recording);
    const TrackResult result = run_track(input, recording);
    ASSERT_EQ(result.hands.size(), 1U);
    EXPECT_EQ(result.hands[0].name, name);
    EXPECT_EQ(result.hands[0].count(FrameStatus::tracked), 200U);
    EXPECT_LT(error_of(result, 0, truth).largest, 1e-6);
    EXPECT_NEAR(*result.person.hand_length, 0.178, 1e-9);
    EXPECT_NEAR(*result.person.hand_breadth, 0.081, 1e-9);
    EXPECT_NEAR(result.person.bones.at("index_proximal"), 0.049, 1e-9);
  }
}

// Oracle: the angles before noise was added. The bound is the goal, 2 deg.
TEST(Track, TwoMillimetresOfNoiseGiveTwoDegreesAtTheFlexionAxes) {
  HANDSIM_SKIP_WITH_SANITIZER("recordings without noise are followed by the same code");
  const TrackInput input = test::shipped_input();
  std::mt19937 random(2);
  MovingHand right(input, other_person(input), model::Side::right);
  MovingHand left(input, other_person(input), model::Side::left);
  Recording recording;
  recording.times = test::frame_times(600, 120);
  right.record("right", 0.002, random, recording);
  left.record("left", 0.002, random, recording);
  const TrackResult result = run_track(input, recording);
  ASSERT_EQ(result.hands.size(), 2U);
  for (std::size_t h = 0; h < 2; ++h) {
    const AngleError error = error_of(result, h, h == 0 ? right : left);
    EXPECT_EQ(result.hands[h].count(FrameStatus::tracked), 600U);
    EXPECT_LT(error.flexion_rms, 2 * kDegree);
    EXPECT_NEAR(result.hands[h].noise, 0.002, 2e-4);
  }
  std::printf("flexion RMS %.3f %.3f deg, cpu %.3f s for %zu frames; person %.4f %.4f\n",
              error_of(result, 0, right).flexion_rms / kDegree,
              error_of(result, 1, left).flexion_rms / kDegree, result.cpu, 2 * result.times.size(),
              *result.person.hand_length, *result.person.hand_breadth);
}

Seen<Vec3> without(const Seen<Vec3>& points, std::size_t frame) {
  Seen<Vec3> out;
  for (std::size_t i = 0; i < points.frames().size(); ++i)
    if (points.frames()[i] != frame) out.add(points.frames()[i], points.values()[i]);
  return out;
}

// Oracle: the frames that were taken away, exchanged, or spoilt below; all others are tracked.
TEST(Track, FramesWithoutAHandOrWithSwappedHandsAreMarked) {
  const TrackInput input = test::shipped_input();
  std::mt19937 random(3);
  MovingHand right(input, other_person(input), model::Side::right);
  MovingHand left(input, other_person(input), model::Side::left);
  Recording recording;
  recording.times = test::frame_times(120, 60);
  right.record("right", 0.001, random, recording);
  left.record("left", 0.001, random, recording);
  for (auto& [channel, values] : recording.channels) {
    if (channel.starts_with("right")) values.points = without(values.points, 40);
    // One wild point and three that are not seen do not spoil a frame.
    if (channel == "right.index_tip") *values.points.at(60) += Vec3(0.2, 0, 0);
    if (channel.starts_with("right.middle_") && channel != "right.middle_mcp")
      values.points = without(values.points, 70);
    if (channel.starts_with("left"))
      std::swap(*values.points.at(80), *recording.channels["right" + channel.substr(4)].points.at(80));
  }
  const TrackResult result = run_track(input, recording);
  for (std::size_t h = 0; h < 2; ++h)
    for (std::size_t k = 0; k < 120; ++k) {
      const FrameStatus expected = k == 80             ? FrameStatus::swapped
                                   : h == 0 && k == 40 ? FrameStatus::missing
                                                       : FrameStatus::tracked;
      EXPECT_EQ(name(result.hands[h].frames[k].status), name(expected)) << result.hands[h].name << k;
    }
  EXPECT_LT(error_of(result, 0, right).flexion_rms, 2 * kDegree);
  const auto& distances = result.hands[0].frames[60].distances;
  EXPECT_EQ(std::count(distances.begin(), distances.end(), std::nullopt), 1);
  EXPECT_FALSE(distances[8]);
}

// A left hand under the name of the right one, from the first frame on: only its shape tells. Oracle: the
// side.
TEST(Track, AHandUnderTheNameOfTheOtherIsMarkedByItsShape) {
  const TrackInput input = test::shipped_input();
  std::mt19937 random(4);
  MovingHand left(input, other_person(input), model::Side::left);
  Recording recording;
  recording.times = test::frame_times(60, 30);
  left.record("right", 0.001, random, recording);
  const TrackResult result = run_track(input, recording);
  EXPECT_EQ(result.hands[0].count(FrameStatus::swapped), 60U);
}

// Oracle: the angles from which the sensors' orientations were computed; their mounting is known.
TEST(Track, SensorsOfAGloveGiveTheAnglesBack) {
  TrackInput input = test::shipped_input();
  input.fit_bones = false;
  input.markers.emplace();
  MovingHand truth(input, input.person, model::Side::right);
  Recording recording;
  recording.times = test::frame_times(100, 100);
  std::vector<std::string> segments = {"palm"};
  for (const hand::SegmentSpec& segment : input.model.segments) segments.push_back(segment.name);
  for (const std::string& segment : segments)
    input.markers->markers.push_back({"s_" + segment,
                                      model::Side::right,
                                      segment,
                                      Vec3::Zero(),
                                      rotation_quaternion({0.3, -0.2, 0.5}),
                                      Feature::Kind::orientation,
                                      {}});
  const std::vector<Feature> features = features_of(*input.markers, input.model, model::Side::right);
  for (std::size_t k = 0; k < recording.times.size(); ++k) {
    const HandPose pose = truth.pose(recording.times[k]);
    truth.tree.place(pose.angles);
    for (const Feature& feature : features) {
      recording.channels[feature.name].orientations.add(k, pose.wrist.q * truth.tree.orientation(feature));
    }
  }
  const TrackResult result = run_track(input, recording);
  EXPECT_EQ(result.hands.at(0).count(FrameStatus::tracked), 100U);
  EXPECT_LT(error_of(result, 0, truth).largest, 1e-6);
}

// Oracle: the text of the recording, 20 times. Without blocks the smoothing alone took 17 kB for each frame
// of 200 to 600 bytes.
TEST(Track, MemoryDoesNotGrowWithTheFramesThatAreSmoothed) {
  HANDSIM_SKIP_WITH_SANITIZER("the bound is that of a release build");
  const TrackInput input = test::shipped_input();
  std::mt19937 random(6);
  MovingHand truth(input, input.person, model::Side::right);
  Recording recording;
  recording.times = test::frame_times(5000, 100);
  truth.record("right", 0.001, random, recording);
  const double before = test::peak_memory();
  const TrackResult result = run_track(input, recording);
  EXPECT_EQ(result.hands[0].count(FrameStatus::tracked), 5000U);
  EXPECT_LT(test::peak_memory() - before, 20 * 5000 * 600.0);
}

// Oracle: the other method of the same equations, in one block: the recording of the first frames.
TEST(Track, SmoothingInBlocksIsThatOfOneBlock) {
  const TrackInput input = test::shipped_input();
  std::mt19937 random(7);
  MovingHand truth(input, input.person, model::Side::right);
  HandTree tree = truth.tree;
  const std::size_t count = 2100;
  const std::vector<double> times = test::frame_times(count, 100);
  std::vector<HandPose> noisy;
  std::normal_distribution<double> normal(0, 0.02);
  for (const double time : times) {
    noisy.push_back(truth.pose(time));
    for (double& angle : noisy.back().angles) angle += normal(random);
  }
  const auto smoothed = [&](std::size_t begin, std::size_t end) {
    std::vector<HandPose> poses(noisy.begin() + static_cast<std::ptrdiff_t>(begin),
                                noisy.begin() + static_cast<std::ptrdiff_t>(end));
    const auto size = static_cast<Eigen::Index>(tree.size());
    const std::vector<HandPose> measured = poses;
    const auto known = [&](std::size_t k, const HandPose& at) {
      Rows out{Eigen::VectorXd::Zero(size), Eigen::MatrixXd::Identity(size, size)};
      for (std::size_t i = 0; i < at.angles.size(); ++i)
        out.residuals[static_cast<Eigen::Index>(6 + i)] = at.angles[i] - measured[k].angles[i];
      return out;
    };
    smooth({times.begin() + static_cast<std::ptrdiff_t>(begin),
            times.begin() + static_cast<std::ptrdiff_t>(end)},
           known, 0.02, {}, tree, poses);
    return poses;
  };
  // Frames 600 to 1600 are one block; those of the whole, of which the second begins at 1024, agree in the
  // middle.
  const std::vector<HandPose> all = smoothed(0, count), middle = smoothed(600, 1600);
  for (std::size_t k = 1000; k < 1050; ++k)
    for (std::size_t i = 0; i < tree.axes().size(); ++i)
      EXPECT_NEAR(all[k].angles[i], middle[k - 600].angles[i], 1e-12) << k << tree.axes()[i].name;
}

// Measured angles that go beyond both stops, with noise. Oracle: of each axis alone the same sum of squares
// within the stops, by descent along one frame's angle after the other.
TEST(Track, SmoothingWithinStopsIsTheBoundedMinimum) {
  const TrackInput input = test::shipped_input();
  const MovingHand truth(input, input.person, model::Side::right);
  const HandTree& tree = truth.tree;
  constexpr std::size_t kCount = 24;
  constexpr double kNoise = 0.2;
  const MotionPrior prior;
  const std::vector<double> times = test::frame_times(kCount, 30);
  std::mt19937 random(11);
  std::normal_distribution<double> normal(0, 0.1);
  std::vector<HandPose> measured(kCount, truth.pose(0)), poses;
  for (std::size_t i = 0; i < tree.axes().size(); ++i) {
    const double middle = (tree.axes()[i].low + tree.axes()[i].high) / 2;
    const double half = (tree.axes()[i].high - tree.axes()[i].low) / 2;
    for (std::size_t k = 0; k < kCount; ++k)
      measured[k].angles[i] =
          middle + half * (1.3 * std::sin(8 * times[k] + static_cast<double>(i)) + normal(random));
  }
  const auto size = static_cast<Eigen::Index>(tree.size());
  const auto rows = [&](std::size_t k, const HandPose& at) {
    Rows out{Eigen::VectorXd::Zero(size), Eigen::MatrixXd::Identity(size, size)};
    for (std::size_t i = 0; i < at.angles.size(); ++i)
      out.residuals[static_cast<Eigen::Index>(6 + i)] = at.angles[i] - measured[k].angles[i];
    return out;
  };
  for (const HandPose& pose : measured) poses.push_back(tree.within_stops(pose));
  smooth(times, rows, kNoise, prior, tree, poses);

  const double interval = times[1] - times[0], weight = 1 / (kNoise * kNoise);
  const double stiffness = 1 / (prior.angle * std::pow(interval, 3));
  Eigen::MatrixXd hessian = weight * Eigen::MatrixXd::Identity(kCount, kCount);
  for (Eigen::Index k = 1; k + 1 < static_cast<Eigen::Index>(kCount); ++k) {
    const Eigen::RowVector3d change(1, -2, 1);
    hessian.block<3, 3>(k - 1, k - 1) += stiffness * change.transpose() * change;
  }
  std::size_t at_stops = 0;
  for (std::size_t i = 0; i < tree.axes().size(); ++i) {
    const TreeAxis& axis = tree.axes()[i];
    Eigen::VectorXd wanted(kCount), best = Eigen::VectorXd::Constant(kCount, axis.low);
    for (std::size_t k = 0; k < kCount; ++k) wanted[static_cast<Eigen::Index>(k)] = measured[k].angles[i];
    double moved = 1;
    while (moved > 1e-12) {
      moved = 0;
      for (Eigen::Index k = 0; k < best.size(); ++k) {
        const double downhill = weight * wanted[k] - hessian.row(k).dot(best), before = best[k];
        best[k] = std::clamp(before + downhill / hessian(k, k), axis.low, axis.high);
        moved = std::max(moved, std::abs(best[k] - before));
      }
    }
    for (std::size_t k = 0; k < kCount; ++k) {
      EXPECT_NEAR(poses[k].angles[i], best[static_cast<Eigen::Index>(k)], 1e-4) << axis.name << " " << k;
      if (poses[k].angles[i] == axis.low || poses[k].angles[i] == axis.high) ++at_stops;
    }
  }
  EXPECT_GT(at_stops, 3 * tree.axes().size());
}

// Markers on the palm and the index finger alone: its joints, and no others, are determined. Oracle: the
// angles.
TEST(Track, AxesThatNoMarkerDeterminesAreNotInvented) {
  TrackInput input = test::shipped_input();
  input.smooth = false;
  input.markers.emplace();
  MovingHand truth(input, input.person, model::Side::right);
  Recording recording;
  recording.times = test::frame_times(50, 50);
  const auto add = [&](const std::string& name, const std::string& segment, const Vec3& at) {
    input.markers->markers.push_back(
        {name, model::Side::right, segment, at, Quat::Identity(), Feature::Kind::point, {}});
  };
  add("a", "palm", {0, 0, 0.01});
  add("b", "palm", {0.03, 0.08, 0.01});
  add("c", "palm", {-0.03, 0.07, 0.01});
  add("d", "index_proximal", {0, 0.02, 0.01});
  add("e", "index_middle", {0, 0.01, 0.01});
  add("f", "index_distal", {0, 0.01, 0.01});
  const std::vector<Feature> features = features_of(*input.markers, input.model, model::Side::right);
  for (std::size_t k = 0; k < recording.times.size(); ++k) {
    const HandPose pose = truth.pose(recording.times[k]);
    truth.tree.place(pose.angles);
    for (const Feature& feature : features) {
      recording.channels[feature.name].points.add(k, pose.wrist * truth.tree.point(feature));
    }
  }
  const TrackedHand hand = run_track(input, recording).hands.at(0);
  EXPECT_EQ(hand.count(FrameStatus::tracked), 50U);
  for (std::size_t i = 0; i < hand.axes.size(); ++i) {
    EXPECT_EQ(hand.determined[i], hand.axes[i].starts_with("index")) << hand.axes[i];
    if (hand.determined[i]) {
      EXPECT_NEAR(hand.frames[20].pose.angles[i], truth.pose(0.4).angles[i], 1e-6);
    }
  }
}

}  // namespace
}  // namespace handsim::study
