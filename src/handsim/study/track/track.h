// Inverse kinematics of recorded hands: joint angles and wrist poses of keypoints, markers or sensors.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "handsim/study/track/marker_set.h"
#include "handsim/study/track/recording.h"
#include "handsim/study/track/smoother.h"

namespace handsim::study {

/// The result of a hand in a frame. Only tracked frames have angles.
enum class FrameStatus {
  tracked,
  missing,  ///< too few points were seen
  swapped,  ///< the points are those of the other hand
  poor,     ///< no pose of the hand comes near the points
};
std::string_view name(FrameStatus status);

struct TrackInput {
  std::filesystem::path recording;
  std::optional<MarkerSet> markers;  ///< or the convention of a tracker; absent: 21 keypoints
  std::optional<char> up;            ///< `y`, `z`: in place of the convention's
  std::optional<bool> left_handed;   ///< axes, in place of the convention's
  hand::HandSpec model;
  std::filesystem::path model_file;
  hand::Person person;
  bool person_named = true;  ///< false: `person` stands for an unknown one
  bool fit_bones = true;     ///< from keypoints or markers; sensors alone show no sizes
  double outlier = 0.025;    ///< a point farther than this from the fit is left out [m]
  double limit = 0.01;       ///< a frame whose RMS distance is larger is marked as poor [m]
  bool smooth = true;
  MotionPrior prior;
  double noise = 0;                            ///< is added to every coordinate, for trials [m]
  unsigned seed = 1;                           ///< of that noise
  std::optional<std::filesystem::path> truth;  ///< joint angles with which the result is compared
};

/// One hand in one frame.
struct TrackedFrame : FitResult {
  FrameStatus status = FrameStatus::missing;
};

/// Shapes of a hand that penetrate each other in its tracked poses.
struct OverlapFigures {
  struct Pair {
    double depth = 0;  ///< deepest [m]
    double time = 0;   ///< of it [s]
  };
  std::size_t tested = 0;             ///< frames, evenly over the recording
  std::size_t frames = 0;             ///< of those with an overlap of more than 1 mm
  std::map<std::string, Pair> pairs;  ///< by `right.index_distal and right.middle_distal`

  /// The deepest pair; the end without one.
  std::map<std::string, Pair>::const_iterator deepest() const {
    return std::ranges::max_element(pairs, {}, [](const auto& each) { return each.second.depth; });
  }
};

/// Difference from known angles.
struct TruthFigures {
  std::string axis;
  double rms = 0;  ///< [rad]
};

struct TrackedHand {
  std::string name;  ///< `right`, `left`
  model::Side side = model::Side::right;
  std::vector<std::string> axes;  ///< names of the angles
  std::vector<bool> determined;   ///< by axis: a feature moves with it; the others stay where they started
  std::vector<std::string> features;  ///< names
  std::vector<TrackedFrame> frames;   ///< at the indices of TrackResult::times
  OverlapFigures overlaps;
  std::vector<TruthFigures> truth;  ///< by axis; empty without a table of known angles
  double noise = 0;                 ///< estimated standard deviation of a coordinate [m]

  std::size_t count(FrameStatus status) const;
};

/// Where the two hands of a recording were inside each other, before their wrists were moved apart.
struct BetweenHands {
  std::size_t frames = 0;  ///< with an overlap of more than kGive
  double depth = 0;        ///< the deepest [m]
  double time = 0;         ///< of it [s]
  std::string where;       ///< `right.index_distal and left.palm.index`
  double moved = 0;        ///< of each wrist, at most [m]
};

struct TrackResult {
  std::vector<double> times;           ///< [s]
  double start = 0;                    ///< time in the recording that is 0 in what is written [s]
  hand::Person person;                 ///< with the measured hand, if bones were fitted
  std::vector<Vec3> shares;            ///< of the points of each hand, if these were fitted (Feature::shares)
  std::vector<std::string> not_shown;  ///< PersonFit::not_shown
  std::vector<TrackedHand> hands;
  BetweenHands between;
  double cpu = 0;                     ///< CPU time of the fits [s]
  std::vector<std::string> warnings;  ///< what looks wrong in the recording
};

/// What is looked for in a recording, of one hand. @param hand right hand as built.
std::vector<Feature> features_for(const TrackInput& input, const hand::BuiltHand& hand, model::Side side);
/// @throws Error (input) for a recording that cannot be read or has no hand of the marker set.
TrackResult run_track(const TrackInput& input, const std::function<void(double)>& progress = {});
/// Tracks a recording in memory, otherwise as above.
TrackResult run_track(const TrackInput& input, const Recording& recording,
                      const std::function<void(double)>& progress = {});

}  // namespace handsim::study
