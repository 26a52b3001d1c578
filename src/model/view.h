// The side of a hand that a picture shows.
#pragma once

namespace handsim::model {

/// From the back of the hand, from its palm, from the thumb's side, or from above and before the fingertips.
enum class View { dorsal, palmar, radial, three_quarter };

}  // namespace handsim::model
