// `climbs` of a scene: a hand holds until its grip fails. The palm is on a rail along the load. A stiff servo
// lowers it and keeps it while the fingers close; then it is off and an increasing load pulls the palm.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "handsim/hand/grip_strength.h"
#include "handsim/scene/read/task_block.h"

namespace handsim::scene {

/// A load at the wrist that increases with time.
struct LoadSpec {
  Vec3 direction = {0, 0, -1};  ///< world, unit
  double rate = 50;             ///< [N/s]
  double most = 1000;           ///< load at the end of the climb [N]
};

struct ClimbPlan {
  std::size_t hand = 0;           ///< in SceneSpec::hands
  std::string hold;               ///< name of the object
  std::vector<TaskPhase> phases;  ///< approach, close, load
  double height = 0;              ///< of the wrist's start above the hold pose [m]
  LoadSpec load;                  ///< mirrored for a left hand
  hand::GripStrength strength;    ///< of the person

  const TaskPhase& approach() const { return phases[0]; }
  const TaskPhase& loading() const { return phases[2]; }
};

std::unique_ptr<TaskSpec> read_climb(MapReader& block);

}  // namespace handsim::scene
