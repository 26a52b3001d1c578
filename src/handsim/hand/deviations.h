// A hand model for a person whose hand is not quite what is predicted.
#pragma once

#include "handsim/hand/hand_file.h"

namespace handsim::hand {

/// The model with the person's deviations in its segments, densities or shares, ranges, tissue, arms and
/// forces, each its spread times the deviation; sizes by exp(). Dimensions and grip strength are the person's
/// own matter.
HandSpec deviated(const HandSpec& spec, const Person& person);

/// The person with measured values that deviate, too, by the spread of measuring: dimensions by their own
/// names, lengths and radii of fingers and bones by `segments`.
Person measured_again(const HandSpec& spec, const Person& person);

/// The names of kDeviations that change this person's hand: without what has no spread.
/// @param muscles whether they act, too
std::vector<std::string> uncertain_of(const HandSpec& spec, const Person& person, bool muscles);

}  // namespace handsim::hand
