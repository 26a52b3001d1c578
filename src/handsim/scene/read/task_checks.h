// Checks that hands, objects and poses of the tasks exist in the scene.
#pragma once

#include "handsim/scene/read/scene_file.h"

namespace handsim::scene {

/// Index of the hand that a task names, or of the only hand if it names none; nothing if there is none.
std::optional<std::size_t> hand_of(const SceneSpec& scene, const TaskSpec& task);

/// Index of the object that a task names; nothing if there is none.
std::optional<std::size_t> object_of(const SceneSpec& scene, const TaskSpec& task);

/// Problems: objects that do not exist or that the task cannot place. Call after they are read.
void check_task_objects(const SceneSpec& scene, Diagnostics& diagnostics);

/// Problems: hands that do not exist or that the task cannot place, two tasks of one hand, hands that no task
/// places. Call after hands and objects are read without a problem.
void check_task_hands(const SceneSpec& scene, Diagnostics& diagnostics);

/// Problems: unknown poses, hands with a program of their own. Call after control is read.
void check_task_programs(const SceneSpec& scene, Diagnostics& diagnostics);

}  // namespace handsim::scene
