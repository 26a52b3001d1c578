// Plans the tasks of a scene: start poses, motions of wrists, programs of hands, phases for figures.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "handsim/scene/read/scene_file.h"
#include "handsim/scene/task/climb.h"
#include "handsim/scene/task/grasp.h"

namespace handsim::scene {

inline const Quantity kSpan = {Dimension::time, 0.01, 1e3};  ///< Duration of a part of a task.

struct TaskSite {
  const SceneSpec& scene;
  std::size_t hand;  ///< in SceneSpec::hands
  const HandEntry& entry;
  const hand::BuiltHand& built;
  const ObjectSpec& object;
};

struct TaskMove {
  double start = 0, time = 0;  ///< [s]
  std::string name;
  std::optional<control::PoseSpec> pose;  ///< absent: the pose of that name in the pose file
};

struct TaskPlan {
  hand::Placement placement;          ///< of the hand
  Pose object_pose;                   ///< X_WO at the start
  std::optional<ObjectSpec> support;  ///< an additional object
  std::vector<TaskMove> moves;        ///< the first, in no time, to the pose at the start
  std::optional<GraspPlan> grasp;
  std::optional<ClimbPlan> climb;
  std::vector<Problem> problems;
  std::vector<std::string> warnings;
};

/// The plans of all tasks of a scene, combined.
struct Plans {
  std::vector<hand::Placement> hands;  ///< of each hand
  std::vector<ObjectSpec> objects;     ///< at their start poses, then the tasks' supports
  std::optional<ControlSpec> control;  ///< with the tasks' programs
  std::vector<GraspPlan> grasps;
  std::vector<ClimbPlan> climbs;
};

std::span<const TaskKind> task_kinds();

/// @param scene without problems. Problems: tasks that exclude each other, a support with an object's name.
Plans make_plans(const SceneSpec& scene, const std::vector<hand::BuiltHand>& hands, Diagnostics& diagnostics);

/// The movements through a task's poses as they stand. @param close start of the first closing pose [s]
std::vector<TaskMove> moves_through_poses(const TaskSpec& task, double close);

/// Reads the keys that blocks of all kinds have: hand, object, wrist and poses.
void read_task(MapReader& block, const char* object_key, TaskSpec& task);

void add_phase(TaskSpec& task, std::string name, double span);

}  // namespace handsim::scene
