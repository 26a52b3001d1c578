// The `control:` block of a scene: which controller drives its hands through which program, and the limits
// that its tracking is judged by.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "handsim/control/plan.h"
#include "handsim/core/yaml_reader.h"
#include "handsim/engine/settings.h"

namespace handsim::scene {

struct HandEntry;

struct ControlSpec {
  control::ControllerSpec controller;
  std::optional<control::PoseFile> poses;
  std::vector<control::ProgramChoice> programs;  ///< one for each hand of the scene, in their order
  bool allow_unstable = false;                   ///< lets explicit gains beyond their stability limit run
  Place place;                                   ///< of the block
};

/// Limits of the tracking figures; absent ones are measured but not judged.
struct TrackingCriteria {
  std::optional<double> rms_error;      ///< of the worst joint over the run [rad]
  std::optional<double> largest_error;  ///< of any joint at any step [rad]
  std::optional<double> steady_error;   ///< largest at the end of any hold [rad]
  std::optional<double> overshoot;      ///< largest, as a share of the movement
  std::optional<double> settling_time;  ///< longest, to 2 % of a movement [s]
};

/// Reads `control`, following its references. @param hands of the scene, named.
/// @param grasped grasps may drive hands without a program.
ControlSpec read_control(MapReader reader, const std::vector<HandEntry>& hands, bool grasped);

/// The plan of a controlled scene's hands. @param grip_strengths of each hand [N], nothing where it is not
/// known. @throws nothing: problems go into the diagnostics.
control::Plan compile_control(const ControlSpec& spec, const std::vector<HandEntry>& hands,
                              const std::vector<std::optional<double>>& grip_strengths,
                              const model::Model& model, const engine::Settings& solver,
                              Diagnostics& diagnostics);

}  // namespace handsim::scene
