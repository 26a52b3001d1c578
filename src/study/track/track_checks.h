// Checks of a tracked hand: fingers that lie inside each other, and the difference from known angles; private
// to this folder.
#pragma once

#include "handsim/control/motion_file.h"
#include "handsim/study/track/track.h"

namespace handsim::study {

/// Fills TrackedHand::overlaps. @param hand right hand as built.
void find_overlaps(const hand::BuiltHand& hand, TrackedHand& tracked);
/// Fills TrackedHand::truth from the columns `HAND.joint.axis` of a table. @throws Error (input) for a table
/// without them.
void compare(const control::MotionTable& table, const std::vector<double>& times, TrackedHand& tracked);
/// What of a recording no hand uses, and times that look like milliseconds.
/// @throws Error (input) where nothing in it is named as a keypoint or marker.
std::vector<std::string> recording_warnings(const TrackInput& input, const Recording& recording);
/// An empty text, or why all frames of a hand may be swapped.
std::string swap_warning(const TrackedHand& tracked);

}  // namespace handsim::study
