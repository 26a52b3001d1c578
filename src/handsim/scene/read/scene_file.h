// The content of a scene file as plain structs in SI, and its reader. It is not changed after reading.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "handsim/scene/read/contacts_block.h"
#include "handsim/scene/read/control_block.h"
#include "handsim/scene/read/criteria.h"
#include "handsim/scene/read/hand_entry.h"
#include "handsim/scene/read/mechanism.h"
#include "handsim/scene/read/objects.h"
#include "handsim/scene/read/run_settings.h"
#include "handsim/scene/read/task_block.h"

namespace handsim::scene {

/// Tables of a run that are written on request.
struct RecordTables {
  bool bodies = false;     ///< bodies.csv: pose and velocity of every body
  bool markers = false;    ///< markers.trc, markers.csv: joint centres and fingertips of every hand
  bool momentum = false;   ///< momentum.csv: mass centre and momentum of every hand
  bool reactions = false;  ///< reactions.csv: force and moment in every joint
};

struct SceneSpec {
  std::string title;
  std::vector<HandEntry> hands;
  std::vector<ObjectSpec> objects;
  std::optional<GroundSpec> ground;
  ContactsSpec contacts;
  MechanismSpec mechanism;
  Vec3 gravity = {0, 0, -9.80665};  ///< [m/s^2]
  engine::Settings solver;          ///< with the effects, `auto` resolved
  std::string engine_choice;        ///< choice of engine `auto` and its reason; empty if the scene names one
  std::string step_choice;          ///< that of `step: auto`, once a run has chosen
  double duration = 1;              ///< [s]
  double record_every = 0.01;       ///< [s]
  bool record_contacts = false;     ///< contacts.csv, and sums of contact forces in the summary
  std::optional<ExcitationSpec> excitations;  ///< of muscles; with muscles only
  RecordTables tables;
  std::optional<ControlSpec> control;  ///< drives the joints; with actuation only
  Tasks tasks;
  PictureSpec pictures;
  Criteria criteria;
  std::vector<std::filesystem::path> files;  ///< that the scene names: meshes, tables of motion

  /// Names of the objects, then of those that tasks add.
  std::vector<std::string> object_names() const;
  /// End of the last task [s]; 0 without any.
  double tasks_end() const;
};

/// Reads a scene, following its references. Problems, defaults and referenced files go into the diagnostics,
/// whose resolution makes the resolved scene.
/// @param kinds of tasks.
SceneSpec read_scene(const YamlNode& root, std::span<const TaskKind> kinds, Diagnostics& diagnostics);

}  // namespace handsim::scene
