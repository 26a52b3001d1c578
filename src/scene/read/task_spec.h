// Tasks: what the hands of a scene are to do. Each kind of task has a list of blocks in the scene, and is
// read and planned by a file of its own in scene/task; this is what readers of other blocks know of them.
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
  const char* object;  ///< key of what the hand takes hold of
  bool moves_object;   ///< the object is free and has no place of its own; otherwise it is static and has one
  hand::Mount mount;   ///< of a hand that the task can place
  std::unique_ptr<TaskSpec> (*read)(MapReader& block);
};

/// A part of a task.
struct TaskPhase {
  std::string name;  ///< e.g. approach, close, lift
  double start = 0;  ///< [s]
  double end = 0;    ///< [s]
};

/// A block of a kind of task: what all kinds have. Geometry is given for a right hand; a left hand gets its
/// mirror image in the world's y-z plane.
struct TaskSpec {
  virtual ~TaskSpec() = default;
  /// What the task makes of its hand and object.
  virtual TaskPlan plan(const TaskSite& site) const = 0;

  double end() const { return phases.back().end; }

  const TaskKind* kind = nullptr;
  Place place;
  std::string path;                    ///< of the block: `grasps.0`
  std::string hand;                    ///< name; empty: the scene's only hand
  std::string object;                  ///< name of what the hand takes hold of
  std::optional<std::string> support;  ///< name of an object that the task adds
  Pose wrist;                          ///< X_WH at the object
  std::string open;                    ///< pose until the hand closes
  std::vector<std::string> closed;     ///< poses that close it, one after the other
  double close_time = 0.6;             ///< of each closing pose [s]
  std::vector<TaskPhase> phases;       ///< one after the other from time 0
};

using Tasks = std::vector<std::shared_ptr<const TaskSpec>>;

}  // namespace handsim::scene
