// Estimates the size of a hand from markers on its segments, together with the poses of some frames.
#pragma once

#include "handsim/study/track/pose_fit.h"
#include "handsim/study/track/recording.h"

namespace handsim::study {

/// The features of one hand and what was measured of them, by frame.
class HandFrames {
 public:
  HandFrames(const Recording& recording, std::vector<Feature> of, model::Side side);
  /// What was measured in one frame, by feature.
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

struct MarkerPerson {
  const hand::Person& predicted;
  bool named = true;  ///< false: taken because nobody was named
};

/// The person with hand length, hand breadth and bones that bring the markers nearest to where they were
/// seen, with the places of the markers on their segments as given. Breadth and bones are held to those
/// predicted for the fitted length with a deviation of 5 %, so that one that the markers do not show grows
/// with the hand; the length to the person's with 5 %, or 25 % for a person that nobody has named.
/// @param warnings gets a text where the markers hardly show the length.
/// @throws Error (input) if fewer than three frames show a hand.
hand::Person fit_bones_to_markers(const std::vector<HandFrames>& hands, const hand::HandSpec& spec,
                                  const MarkerPerson& person, const std::string& recording,
                                  std::vector<std::string>& warnings);

}  // namespace handsim::study
