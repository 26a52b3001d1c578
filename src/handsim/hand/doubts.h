// What makes a person's values doubtful: outside the survey, or in contradiction to each other.
#pragma once

#include <string>
#include <vector>

#include "handsim/hand/hand_file.h"
#include "handsim/hand/person.h"

namespace handsim::hand {

/// A sentence for each doubt. Stature and mass: outside the survey's range. Measured length, breadth and
/// circumference: below percentile 0.1 or above 99.9 among people of the same stature, mass and sex, or of
/// the same other measured values. Hand mass: the same of what the hand model gives a hand of this size, with
/// a standard deviation of 14 %. Outside the survey's range 8 % are added to the survey's scatter, chosen.
std::vector<std::string> doubts(const HandSpec& spec, const Person& person);

}  // namespace handsim::hand
