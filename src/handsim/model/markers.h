// Points of hands that motion capture follows.
#pragma once

#include <string>
#include <vector>

#include "handsim/model/model.h"

namespace handsim::model {

/// A point fixed to a body.
struct Marker {
  std::string name;  ///< unique, e.g. `right.index_pip`
  int body = kWorld;
  Vec3 point = Vec3::Zero();  ///< in the body frame [m]
};

/// Markers of all hands: the wrist joint's centre (`right.wrist`), the finger joints' centres under the names
/// of the joints, and the fingertips under the names of their bodies (`right.index_distal.tip`).
std::vector<Marker> hand_markers(const Model& model);

}  // namespace handsim::model
