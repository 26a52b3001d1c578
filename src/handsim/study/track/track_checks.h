// What looks wrong in a recording and in what was tracked of it; figures beside the tracking.
#pragma once

#include "handsim/control/motion_file.h"
#include "handsim/study/track/track.h"

namespace handsim::study {

/// `right`, `left`.
const char* side_name(model::Side side);

/// Warnings: what of a recording no hand uses, and times that look like milliseconds.
/// @throws Error (input) where nothing in it is named as a keypoint or marker.
std::vector<std::string> recording_warnings(const TrackInput& input, const Recording& recording);
/// An empty text, or why all frames of a hand may be swapped.
std::string swap_warning(const TrackedHand& tracked);
/// Scenes begin at 0, with a hand: other times are counted from the first frame that has one.
void shift_times(TrackResult& result, const std::string& recording);
/// The text of a person file.
std::string person_text(const hand::Person& person);
/// Fills TrackedHand::overlaps. @param hand right hand as built.
void collect_overlaps(const hand::BuiltHand& hand, const std::vector<double>& times, TrackedHand& tracked);
/// Moves the wrists of two hands apart where parts lie deeper in each other than skin gives way, each as far
/// as the other, along the way out of the deepest pair, at most 50 times; fills TrackResult::between.
/// @param hand right hand as built.
void part_hands(const hand::HandSpec& spec, const hand::BuiltHand& hand, TrackResult& result);
/// Fills TrackedHand::truth from a table's columns `HAND.joint.axis`. @throws Error (input) if it has none.
void compare(const control::MotionTable& table, const std::vector<double>& times, TrackedHand& tracked);

}  // namespace handsim::study
