// What each effect of a scene costs and changes: the scene is simulated whole, with each of its effects taken
// away in turn, and without what its solver does besides.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "handsim/scene/compile/scene.h"
#include "handsim/simulation/watch/monitor.h"

namespace handsim::study {

/// The scene without one of its effects, against the whole scene.
struct EffectRow {
  /// The effect's, or a key of the solver that was turned off: `solver.projection`, `solver.speculative`,
  /// `solver.guard`.
  std::string name;
  /// Effects that go with it, as nothing is left for them to act on: friction with the last contact.
  std::vector<model::Effect> with = {};
  double ns_per_step = 0;  ///< CPU time without the effect
  /// Median of what each round saved, less than 0 where it costs more without.
  double saved_ns = 0;
  double noise_ns = 0;                 ///< half the range of the middle half of the rounds
  simulation::Peak angle = {};         ///< largest difference of a joint angle over the run, 0..pi [rad]
  double angle_rms = 0;                ///< of all joint angles over the run [rad]
  simulation::Peak displacement = {};  ///< largest distance between a body's two places over the run [m]
  /// Why the row has no figures: the scene is not possible without the effect, or went wrong.
  std::optional<std::string> fault = {};
};

struct EffectsResult {
  double ns_per_step = 0;   ///< CPU time of the whole scene
  long steps = 0;           ///< of each run
  int repeats = 0;          ///< timed rounds
  bool has_angles = false;  ///< whether any joint turns
  /// In the order of model::Effect; at last, where the scene has them, settings of the solver.
  std::vector<EffectRow> rows;
};

/// @param repeats rounds in which the scene is timed whole and without each effect, in turns; one more goes
///        ahead to warm up.
/// @param progress is called with the share done, 0..1.
/// @throws Error (input) for a scene without effects or that no engine takes, Error (physics) where the whole
///         scene goes wrong.
EffectsResult run_effects(const scene::Scene& scene, int repeats,
                          const std::function<void(double)>& progress);

/// The rows as a table for the screen.
std::string effects_table(const EffectsResult& result);

/// effects.json as text.
std::string effects_json(const scene::Scene& scene, const EffectsResult& result);

/// Writes effects.csv, effects.json and, where gnuplot is installed, effects.png and effects.svg.
/// @returns false where gnuplot is missing or failed; its script effects.gp is there all the same.
/// @throws Error (input) where the folder cannot be written.
bool write_effects(const scene::Scene& scene, const EffectsResult& result, const std::filesystem::path& out);
std::vector<std::string> effects_files();

}  // namespace handsim::study
