// Tasks of a scene's hands: what readers of other blocks need. scene/task reads and plans each kind of task.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "handsim/core/yaml_reader.h"
#include "handsim/hand/build.h"

namespace handsim::scene {

struct TaskSpec;
struct TaskPlan;
struct TaskSite;

struct TaskKind {
  const char* list;    ///< key of its blocks: `grasps`
  const char* what;    ///< for messages: `a grasp`
  const char* object;  ///< key of the object
  bool moves_object;   ///< the object is free and the task places it; otherwise it is static
  hand::Mount mount;   ///< of hands that the task can place
  std::unique_ptr<TaskSpec> (*read)(MapReader& block);
};

struct TaskPhase {
  std::string name;  ///< e.g. approach, close, lift
  double start = 0;  ///< [s]
  double end = 0;    ///< [s]
};

/// What every task's block has. Geometry is for a right hand; a left one has the mirror image in y-z.
struct TaskSpec {
  virtual ~TaskSpec() = default;
  /// Plans the motion of the task's hand and the pose of its object.
  virtual TaskPlan plan(const TaskSite& site) const = 0;

  double end() const { return phases.back().end; }

  const TaskKind* kind = nullptr;
  Place place;
  std::string path;                    ///< of the block: `grasps.0`
  std::optional<std::string> hand;     ///< name; absent: the scene's only hand
  std::string object;                  ///< its name
  std::optional<std::string> support;  ///< name of an object that the task adds
  Pose wrist;                          ///< X_WH at the object
  std::string open;                    ///< pose before the hand closes
  std::vector<std::string> closed;     ///< poses that close it, one after the other
  double close_time = 0.6;             ///< of each closing pose [s]
  std::vector<TaskPhase> phases;       ///< one after the other from time 0
};

using Tasks = std::vector<std::shared_ptr<const TaskSpec>>;

}  // namespace handsim::scene
