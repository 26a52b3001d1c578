// What a recording has of one hand, by frame.
#pragma once

#include "handsim/study/track/pose_fit.h"
#include "handsim/study/track/recording.h"

namespace handsim::study {

/// The features of one hand and what was measured of them, by frame.
class HandFrames {
 public:
  HandFrames(const Recording& recording, std::vector<Feature> of, model::Side side);
  /// The measured points of one frame, by feature.
  MeasuredFrame at(std::size_t frame) const;
  std::size_t size() const { return size_; }
  /// True where some frame has a point, or an orientation.
  bool any(Feature::Kind kind) const;

  model::Side side;
  std::vector<Feature> features;

 private:
  std::size_t size_;
  std::vector<const Channel*> channels_;  ///< by feature; null: not recorded
};

}  // namespace handsim::study
