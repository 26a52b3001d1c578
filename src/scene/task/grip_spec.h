// The `grip` block of a task: with which forces the fingers press.
#pragma once

#include <map>
#include <optional>

#include "handsim/core/yaml_reader.h"
#include "handsim/hand/grip_strength.h"
#include "handsim/model/model.h"

namespace handsim::scene {

/// A `grip` block: with it fingers close until they touch, and press with a force. Without it a task moves
/// its hand through poses as they stand.
struct GripSpec {
  /// Sum of the normal forces of fingers [N], of a person with the controller's grip strength; for others in
  /// proportion to theirs. Fingers that move and are not named balance these.
  std::map<model::Part, double> forces;
  hand::GripTable strength;  ///< norms of grip strength
  double squeeze = 0.3;      ///< time from touching to pressing [s]
  /// Coefficient that the hand reckons with; absent: that of the surfaces that touch.
  std::optional<double> friction;
  double search = 0.2;  ///< the object may lie so far from its named place in the hand [hand lengths]
};

/// Reads a `grip` block.
GripSpec read_grip(MapReader reader);

/// `thumb`, `index`, ...; all other parts are `palm`.
std::string_view part_name(model::Part part);

}  // namespace handsim::scene
