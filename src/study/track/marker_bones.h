// Estimates the size of a hand from markers on its segments, together with the poses of some frames.
#pragma once

#include "handsim/study/track/pose_fit.h"

namespace handsim::study {

/// The features of one hand and what was measured of them, by frame.
struct HandFrames {
  model::Side side = model::Side::right;
  std::vector<Feature> features;
  std::vector<std::vector<MeasuredPoint>> frames;
};

/// The person with hand length, hand breadth and bones that bring the markers nearest to where they were
/// seen, with the places of the markers on their segments as given. A size that the markers hardly determine
/// keeps its predicted value: sizes are held to the predicted ones with a deviation of 5 %.
/// @throws Error (input) if fewer than three frames show a hand.
hand::Person fit_bones_to_markers(const std::vector<HandFrames>& hands, const hand::HandSpec& spec,
                                  const hand::Person& person, const std::string& recording);

}  // namespace handsim::study
