// Runs a scene and writes its files: trajectory.csv, summary.json, resolved.yaml with copies of its meshes
// and motion files (inputs/), pictures; by the scene's content contacts.csv, trajectory.mot (joint angles for
// OpenSim), control.sto and plots/, muscles.sto. A run first removes earlier runs' files from the folder, and
// writes tables and summary before it draws.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "handsim/core/error.h"
#include "handsim/engine/collision/overlap.h"
#include "handsim/output/output_folder.h"
#include "handsim/output/render/image.h"
#include "handsim/scene/compile/scene.h"
#include "handsim/simulation/run/film.h"
#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/watch/climb_figures.h"
#include "handsim/simulation/watch/grasp_figures.h"
#include "handsim/simulation/watch/tracking.h"

namespace handsim::simulation {

class Simulation;

struct RunOptions {
  std::filesystem::path out;   ///< folder for the run's files; created if it is missing
  int frames = 0;              ///< pictures over the run; 0: no OpenGL context is created for them
  bool pose_pictures = false;  ///< a picture at the end of every hold of a controlled scene, or every phase
                               ///< of a grasp or climb, instead of `frames`
  bool monitor = false;        ///< monitor.csv: energies and residuals of the solver
  bool plots = false;          ///< of a controlled scene: plots/ by gnuplot
  std::optional<double> snapshot_at;  ///< Writes snapshot.bin at this time [s], rounded to a step.
  /// Continues from this snapshot file: tables and pictures show the rest of it, the summary all of it.
  std::optional<std::filesystem::path> from_snapshot;
  bool stop_lost = false;  ///< Ends the run once a grasp is decided (GraspFigures::decided).
  std::optional<std::uint64_t> expected_hash;  ///< Expected hash of the states (state_hash.h).
  std::optional<VideoSpec> video;              ///< of the run
  std::optional<output::Gl> gl;  ///< with which pictures are drawn; absent: the default of this build
  /// Draws in a child process, by threads on all cores (output/child.h): without memory only drawing ends.
  bool draw_apart = false;
  std::function<void(double)> progress;  ///< Called repeatedly with the finished share, 0..1.
  /// Called before the run with a message for the user, if the run writes much.
  std::function<void(const std::string&)> note;
};

struct RunResult {
  std::vector<Verdict> verdicts;
  std::optional<PhysicsFault> fault;  ///< of a run that diverged; the files have everything before it
  double simulated = 0;               ///< [s]
  double wall = 0;                    ///< of the loop [s]
  std::string summary;                ///< text of summary.json
  std::vector<std::string> warnings;  ///< Simulation::warnings
  std::uint64_t state_hash = 0;
  std::optional<std::uint64_t> expected_hash;  ///< of the options
  std::optional<double> continued_from;        ///< time of the snapshot from which the run continued [s]
  std::vector<AxisTracking> tracking;          ///< by driven axis; empty without control
  std::vector<GraspFigures> grasps;            ///< of the scene's grasps
  std::vector<ClimbFigures> climbs;            ///< of the scene's climbs
  std::vector<engine::Overlap> overlaps;       ///< of shapes at the start

  /// Requested output that is missing, with the reason: `pictures: ...`, `video: ...`, `plots: ...`.
  std::vector<std::string> missing;

  bool hash_as_expected() const { return !expected_hash || *expected_hash == state_hash; }
  bool passed() const;
  bool judged() const;  ///< there is a criterion
  bool failed() const;  ///< the figure of a criterion is beyond its limit
  bool missed() const;  ///< a criterion has no figure
};

/// Nothing is left to measure: every climb failed and no grasp, or, if asked for, a grasp is decided.
bool over(const Simulation& simulation, bool stop_lost);

/// Runs the scene and writes its files. @throws Error (input), before the run, for an unusable folder
/// (output_folder.h), too large a resolved scene (inputs.h), a snapshot of another scene or past its end,
/// files that do not fit (output_size.h); Error (output) if a table or the summary cannot be written
RunResult run(const scene::Scene& scene, const RunOptions& options);

/// A run's folder, to check those of several runs before the first. @throws Error (input) as OutputFolder
output::OutputFolder run_folder(const scene::Scene& scene, const RunOptions& options);
/// A run into a folder that is locked already; null: the run locks it.
RunResult run(const scene::Scene& scene, const RunOptions& options, const output::OutputFolder* folder);

/// The scene at a time [s], 0 to its duration. @throws Error (physics) if the simulation diverges before.
PictureState picture_state_at(const scene::Scene& scene, double time);

/// Text of summary.json, also of a run that a fault stopped (`result.fault`).
std::string summary_json(const Simulation& simulation, const RunResult& result);

/// @throws Error (input) if gnuplot cannot be started; to be called before a run.
void need_gnuplot();

/// Writes plots/HAND_angles.png, HAND_errors.png, HAND_torques.png and their gnuplot scripts from the run's
/// control.sto, which must exist. @throws Error (output) if gnuplot fails.
void write_plots(const scene::Scene& scene, const std::filesystem::path& out);

}  // namespace handsim::simulation
