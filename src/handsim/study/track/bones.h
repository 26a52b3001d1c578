// Estimates the size of a hand from keypoints: its length and breadth, and the length of each bone.
#pragma once

#include "handsim/hand/hand_file.h"
#include "handsim/study/track/recording.h"

namespace handsim::study {

/// The person with measured hand length and breadth, those that put the joints of the palm where they were
/// seen, and measured bones, from the distances of keypoints of both hands. Outliers are left out. Noise
/// lengthens distances; its share is taken off by their spread over the frames. A bone that fewer than three
/// frames show keeps its predicted length.
/// @throws Error (input) if no frame shows the palm, or the fitted hand is impossible.
hand::Person fit_bones(const Recording& recording, const hand::HandSpec& spec, const hand::Person& person);

/// The text of a person file.
std::string person_text(const hand::Person& person);

}  // namespace handsim::study
