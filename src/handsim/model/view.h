// The side of a hand that a picture shows.
#pragma once

namespace handsim::model {

/// From the back of the hand, its palm, the thumb's side, or obliquely from above in front of the fingertips.
enum class View { dorsal, palmar, radial, three_quarter };

}  // namespace handsim::model
