// The `hands` of a scene: model, person, side, wrist, start pose, tissue.
#pragma once

#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/hand/build.h"
#include "handsim/scene/read/task_spec.h"

namespace handsim::scene {

struct HandEntry {
  hand::HandSpec model;
  hand::Person person;
  hand::Placement placement;  ///< where no task gives the wrist another
  Place place;                ///< in the file, for problems found later

  bool has_wrist_joint() const {
    return placement.mount == hand::Mount::hinge || placement.mount == hand::Mount::universal;
  }
};

/// Absent: none. Hands are named `right`, `left`, and `right2`, ... where a scene has more of a side.
/// @param tasks where they place hands of a mount, a driven wrist may lack a motion, and a rail has no place.
std::vector<HandEntry> read_hands(MapReader& reader, const Tasks& tasks);

}  // namespace handsim::scene
