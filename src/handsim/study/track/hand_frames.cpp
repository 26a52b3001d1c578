#include "handsim/study/track/hand_frames.h"

#include <algorithm>
#include <cmath>

namespace handsim::study {

/// Confidence with which a point counts at least: one of 0 that counts as seen is not without any weight.
constexpr double kLeast = 1e-3;

HandFrames::HandFrames(const Recording& recording, std::vector<Feature> of, model::Side of_side)
    : side(of_side), features(std::move(of)), size_(recording.times.size()) {
  for (const Feature& feature : features) {
    const auto found = recording.channels.find(feature.name);
    channels_.push_back(found == recording.channels.end() ? nullptr : &found->second);
  }
}

MeasuredFrame HandFrames::at(std::size_t frame) const {
  MeasuredFrame out(features.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (!channels_[i]) continue;
    if (features[i].kind == Feature::Kind::point) {
      if (const Vec3* point = channels_[i]->points.at(frame)) out[i].point = *point;
      if (const double* sure = channels_[i]->confidences.at(frame))
        out[i].weight = std::sqrt(std::max(*sure, kLeast));
    } else if (const Quat* orientation = channels_[i]->orientations.at(frame)) {
      out[i].orientation = *orientation;
    }
  }
  return out;
}

bool HandFrames::any(Feature::Kind kind) const {
  for (std::size_t i = 0; i < features.size(); ++i)
    if (features[i].kind == kind && channels_[i] &&
        !(kind == Feature::Kind::point ? channels_[i]->points.empty() : channels_[i]->orientations.empty()))
      return true;
  return false;
}

}  // namespace handsim::study
