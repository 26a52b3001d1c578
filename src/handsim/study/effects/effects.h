// Measures the cost and the influence of each effect of a scene: simulates the scene complete, without each
// of its effects in turn, and without some settings of its solver.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "handsim/scene/compile/scene.h"
#include "handsim/simulation/watch/monitor.h"
#include "handsim/study/study_run.h"

namespace handsim::study {

/// Comparison of the scene without one effect with the complete scene.
struct EffectRow {
  /// Name of the effect, or a setting turned off: `solver.projection`, `solver.speculative`.
  std::string name;
  /// Effects that were removed with it because they need it, e.g. friction with the last contact effect.
  std::vector<model::Effect> with = {};
  std::string set = {};    ///< override of the scene that removes them; empty for a solver setting
  double ns_per_step = 0;  ///< CPU time without the effect
  /// Median over the rounds of the time saved per step; negative if the step is slower without the effect.
  double saved_ns = 0;
  double noise_ns = 0;          ///< half the interquartile range of the rounds
  simulation::Peak angle = {};  ///< largest difference of a joint angle over the run, 0..pi [rad]
  double angle_rms = 0;         ///< of all joint angles over the run [rad]
  simulation::Peak displacement =
      {};  ///< largest distance between the two positions of a body over the run [m]
  /// Why the row has no figures: the scene needs the effect, or its simulation failed.
  std::optional<std::string> fault = {};
};

struct EffectsResult {
  double ns_per_step = 0;   ///< CPU time of the whole scene
  long steps = 0;           ///< of each run
  int repeats = 0;          ///< timed rounds
  bool has_angles = false;  ///< true if a joint has an angle
  /// In the order of model::Effect; then the settings of the solver that the scene uses.
  std::vector<EffectRow> rows;
};

/// @param repeats timed rounds, each with one run of the complete scene and of each variant; one more round
///         warms up.
/// @param progress is called with the finished share, 0..1.
/// @throws Error (input) for a scene without effects or an engine, Error (physics) if the whole scene fails.
EffectsResult run_effects(const scene::Scene& scene, int repeats,
                          const std::function<void(double)>& progress);

struct EffectsOptions {
  std::optional<std::filesystem::path> file;  ///< of the scene, for the commands that repeat rows
  std::vector<std::string> overrides;         ///< which the scene has already
  int repeats = 7;                            ///< timed rounds
};
/// The whole study, with effects.csv, effects.json and, if gnuplot is installed, effects.png and effects.svg.
/// @throws Error as run_effects(), Error (input) if the folder cannot be written.
StudyEnd effects(const scene::Scene& scene, const EffectsOptions& options, const StudyRun& run);

}  // namespace handsim::study
