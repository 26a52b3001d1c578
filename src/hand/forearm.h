// The body between the world and a wrist; private to this folder.
#pragma once

#include "handsim/hand/build.h"

namespace handsim::hand {

/// The elbow lies on the hand frame's y axis behind the wrist.
BuiltHand::Forearm forearm_of(const ForearmSpec& spec, const HandSize& size, const Person& person);

}  // namespace handsim::hand
