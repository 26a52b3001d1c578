// Whether the tasks of a scene name what the scene has.
#pragma once

#include "handsim/scene/read/scene_spec.h"

namespace handsim::scene {

/// Index of the hand of a task's name, or of the only hand where it names none; nothing where there is none.
std::optional<std::size_t> hand_of(const SceneSpec& scene, const TaskSpec& task);

/// Index of the object of a task.
std::optional<std::size_t> object_of(const SceneSpec& scene, const TaskSpec& task);

/// Problems: hands and objects that the scene has not or the task cannot place, two tasks of one hand, hands
/// that no task places. Hands and objects have to be read.
void check_task_sites(const SceneSpec& scene, Diagnostics& diagnostics);

/// Problems: poses that the pose file has not, hands with a program of their own. Control has to be read.
void check_task_programs(const SceneSpec& scene, Diagnostics& diagnostics);

}  // namespace handsim::scene
