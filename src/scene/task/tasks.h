// The tasks of a scene, planned: which pose each hand and object starts in, how wrists move, which programs
// drive the hands, and what figures are computed from. The scene stays as it was read.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "handsim/scene/read/scene_spec.h"
#include "handsim/scene/task/climb.h"
#include "handsim/scene/task/grasp.h"

namespace handsim::scene {

/// Of a part of a task.
inline const Quantity kSpan = {Dimension::time, 0.01, 1e3};

/// The hand and the object of a task.
struct TaskSite {
  std::size_t hand;  ///< in SceneSpec::hands
  const HandEntry& entry;
  const hand::BuiltHand& built;
  const ObjectSpec& object;
};

/// What a task makes of its hand and object.
struct TaskPlan {
  hand::Placement placement;          ///< of the hand
  Pose object_pose;                   ///< X_WO at the start
  std::optional<ObjectSpec> support;  ///< an object that is added
  double close = 0;                   ///< when the first of the closing poses begins [s]
  std::optional<GraspPlan> grasp;
  std::optional<ClimbPlan> climb;
  std::vector<std::string> warnings;
};

/// What the tasks of a scene make of it.
struct Plans {
  std::vector<hand::Placement> hands;  ///< of each hand
  std::vector<ObjectSpec> objects;     ///< at their starting places, then the tasks' supports
  std::optional<ControlSpec> control;  ///< with the tasks' programs
  std::vector<GraspPlan> grasps;
  std::vector<ClimbPlan> climbs;
};

/// The kinds of task that a scene may have.
std::span<const TaskKind> task_kinds();

/// @param scene as read_scene() leaves it, without problems. @param hands of the scene.
/// Problems: tasks that exclude each other, and supports whose name is taken.
Plans make_plans(const SceneSpec& scene, const std::vector<hand::BuiltHand>& hands, Diagnostics& diagnostics);

/// Keys that blocks of all kinds have: the hand and its object, its wrist there, and the poses.
void read_task(MapReader& block, const char* object_key, TaskSpec& task);

/// The next phase of a task.
void add_phase(TaskSpec& task, std::string name, double span);

}  // namespace handsim::scene
