// A hand that moves all its joints, and the recording that an exact camera makes of it.
#pragma once

#include <cmath>
#include <optional>
#include <random>

#include "handsim/study/track/track.h"
#include "places.h"

namespace handsim::test {

inline study::TrackInput shipped_input() {
  study::TrackInput input;
  Diagnostics diagnostics;
  input.recording = "synthetic.csv";
  input.model_file = test::in_source("handmodels/anatomical.yaml");
  YamlNode model = load_yaml(input.model_file);
  input.model = hand::read_hand_spec(model, "", diagnostics);
  YamlNode person = load_yaml(test::in_source("config/persons/median_man.yaml"));
  input.person = hand::read_person(person, "", diagnostics);
  diagnostics.throw_if_any();
  return input;
}

/// Every axis swings within the middle 80 % of its range at its own frequency of 0.3 to 0.8 Hz; the wrist
/// moves by 10 cm and turns by 0.6 rad.
struct MovingHand {
  study::HandTree tree;
  std::vector<study::Feature> features;
  double thumb = 1;             ///< of the swing of its axes: with 1 it passes through the palm
  std::optional<double> still;  ///< the moment whose posture it keeps
  double bent =
      0.5;  ///< where in its range the middle of an axis' swing lies; it swings by 80 % of what is left

  MovingHand(const study::TrackInput& input, const hand::Person& person, model::Side side)
      : tree(input.model, hand::build_hand(input.model, person), side),
        features(study::keypoints(input.model, hand::build_hand(input.model, person))) {}

  study::HandPose pose(double time) const {
    time = still.value_or(time);
    study::HandPose out;
    const double mirror = tree.side() == model::Side::left ? -1 : 1;
    out.wrist.p = Vec3(mirror * (0.15 + 0.1 * std::sin(2 * time)), 0.05 * std::cos(3 * time), 0.3);
    out.wrist.q = rotation_quaternion(Vec3(0.6 * std::sin(2.5 * time), 0.4, 0.5 * std::cos(2 * time)));
    double phase = 0;
    for (const study::TreeAxis& axis : tree.axes()) {
      phase += 0.7;
      const double range = axis.high - axis.low, share = axis.flexion ? bent : 0.5;
      const double middle = axis.low + share * range,
                   swing = 0.8 * share * range * (axis.name.starts_with("thumb") ? thumb : 1);
      const double frequency = 0.3 + 0.5 * std::fmod(0.37 * phase, 1.0);
      out.angles.push_back(middle + swing * std::sin(2 * M_PI * frequency * time + phase));
    }
    return out;
  }

  Vec3 point(const study::HandPose& pose, std::size_t feature) const {
    return pose.wrist * tree.point(features[feature]);
  }

  /// Adds the hand's frames under a side's name. @param noise standard deviation of each coordinate [m].
  void record(const std::string& side, double noise, std::mt19937& random, study::Recording& out) {
    std::normal_distribution<double> normal(0, 1);
    for (std::size_t k = 0; k < out.times.size(); ++k) {
      const study::HandPose now = pose(out.times[k]);
      tree.place(now.angles);
      for (std::size_t i = 0; i < features.size(); ++i) {
        const Vec3 error(normal(random), normal(random), normal(random));
        out.channels[side + "." + features[i].name].points.add(k, point(now, i) + noise * error);
      }
    }
  }
};

inline std::vector<double> frame_times(std::size_t count, double rate) {
  std::vector<double> out;
  for (std::size_t k = 0; k < count; ++k) out.push_back(static_cast<double>(k) / rate);
  return out;
}

}  // namespace handsim::test
