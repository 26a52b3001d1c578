// Checks of a tracked hand: fingers inside each other, difference from known angles; private to this folder.
#pragma once

#include "handsim/control/motion_file.h"
#include "handsim/study/track/track.h"

namespace handsim::study {

/// Fills TrackedHand::overlaps. @param hand right hand as built.
void find_overlaps(const hand::BuiltHand& hand, TrackedHand& tracked);
/// Fills TrackedHand::truth from a table's columns `HAND.joint.axis`. @throws Error (input) if it has none.
void compare(const control::MotionTable& table, const std::vector<double>& times, TrackedHand& tracked);
/// What of a recording no hand uses, and times that look like milliseconds.
/// @throws Error (input) where nothing in it is named as a keypoint or marker.
std::vector<std::string> recording_warnings(const TrackInput& input, const Recording& recording);
/// An empty text, or why all frames of a hand may be swapped.
std::string swap_warning(const TrackedHand& tracked);

}  // namespace handsim::study
