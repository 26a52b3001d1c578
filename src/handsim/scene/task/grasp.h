// `grasps` of a scene, a block each: the wrist moves, the fingers close, the hand lifts, holds and shakes.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/hand/grip_strength.h"
#include "handsim/scene/read/task_block.h"

namespace handsim::scene {

/// The plan of a grasp, from which its figures are computed.
struct GraspPlan {
  std::size_t hand = 0;                        ///< in SceneSpec::hands
  std::string object;                          ///< name of a body
  std::vector<TaskPhase> phases;               ///< approach, close, lift, hold, shake_1, ..., rest
  std::optional<hand::GripStrength> strength;  ///< of the person, with a `grip`

  double end() const { return phases.back().end; }
  /// Null if the grasp has no such phase.
  const TaskPhase* phase(std::string_view name) const;
};

std::unique_ptr<TaskSpec> read_grasp(MapReader& block);

}  // namespace handsim::scene
