// What if: a hand model with a nerve blocked, a tendon moved, a pulley torn, a joint fused. The keys stand
// in a scene's hand, in a hand model file and in a file of measurements.
#pragma once

#include "handsim/hand/hand_file.h"

namespace handsim::hand {

/// Reads `without`, `transfers`, `pulleys`, `strength`, `fused` and `range_limits` of a map. What the hand
/// cannot have is a problem. @return the changed model; nothing where the map has none of the keys
std::optional<HandSpec> read_what_if(MapReader& reader, const HandSpec& spec);

}  // namespace handsim::hand
