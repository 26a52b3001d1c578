// The `control` block of a scene: its controller, and the program of each hand; and the scene's key
// `excitations`.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/control/plan.h"
#include "handsim/scene/read/hand_entry.h"

namespace handsim::scene {

struct ControlSpec {
  control::ControllerSpec controller;
  std::optional<control::PoseFile> poses;
  std::vector<control::ProgramChoice> programs;  ///< one for each hand of the scene, in their order
  bool by_muscles = false;                       ///< `drive: muscles`: torques become excitations
  control::MotionOptions motion;                 ///< for programs that are motion files
  bool allow_unstable = false;                   ///< accepts explicit gains beyond their limit
  Place place;                                   ///< of the block
};

/// `excitations`: a table of excitations over time, columns `HAND.MUSCLE`, or `MUSCLE` for every hand.
struct ExcitationSpec {
  std::string file;            ///< empty: the table is in the scene
  control::MotionTable table;  ///< then
  Place place;
};

/// Reads `excitations`, if the scene has it.
std::optional<ExcitationSpec> read_excitations(MapReader& scene);

/// Reads `control`, following its references. @param hands of the scene, named.
/// @param has_tasks true if tasks may drive hands without a program.
ControlSpec read_control(MapReader reader, const std::vector<HandEntry>& hands, bool has_tasks);

}  // namespace handsim::scene
