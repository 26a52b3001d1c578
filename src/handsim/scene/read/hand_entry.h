// The `hands` of a scene: model, person, side, wrist, start pose, tissue.
#pragma once

#include <memory>
#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/hand/build.h"
#include "handsim/scene/read/task_block.h"

namespace handsim::scene {

struct HandEntry {
  std::shared_ptr<const hand::HandSpec> model;  ///< of all hands with an equal one
  hand::Person person;
  hand::Placement placement;  ///< unless a task moves the wrist
  Place place;                ///< in the file, for problems found later

  bool has_wrist_joint() const {
    return placement.mount == hand::Mount::hinge || placement.mount == hand::Mount::universal;
  }
};

/// Reads `hands`; may be absent. Hands are named `right`, `left`, `right2`, ...
/// @param tasks if they place hands of a mount, driven wrists may lack a motion, and rails have no pose.
std::vector<HandEntry> read_hands(MapReader& reader, const Tasks& tasks);

}  // namespace handsim::scene
