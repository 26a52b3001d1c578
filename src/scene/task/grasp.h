// `grasps` of a scene: a hand is to grasp an object, in one block. The wrist goes to the object, the fingers
// close, and the hand lifts, holds and shakes it.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/scene/read/task_spec.h"

namespace handsim::scene {

/// A grasp as it is run: what its figures are computed from.
struct GraspPlan {
  std::size_t hand = 0;           ///< in SceneSpec::hands
  std::string object;             ///< name of a body
  std::vector<TaskPhase> phases;  ///< approach, close, lift, hold, shake_1, ..., rest

  double end() const { return phases.back().end; }
  /// Null where the grasp has no such phase.
  const TaskPhase* phase(std::string_view name) const;
};

/// A block of `grasps`.
std::unique_ptr<TaskSpec> read_grasp(MapReader& block);

}  // namespace handsim::scene
