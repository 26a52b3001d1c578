// One execution of a scene with its files: trajectory.csv, summary.json, resolved.yaml with the meshes and
// motion files it names (inputs/), pictures; contacts.csv where the scene records contacts; trajectory.mot
// (joint angles for OpenSim, where there are joints), control.sto and plots/ where the scene is controlled.
// What an earlier run has left in the folder is removed when a run starts; tables and summary are written
// before anything is drawn.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "handsim/core/error.h"
#include "handsim/engine/contact/overlap.h"
#include "handsim/output/output_folder.h"
#include "handsim/output/render/image.h"
#include "handsim/scene/compile/scene.h"
#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/watch/climb_figures.h"
#include "handsim/simulation/watch/grasp_figures.h"
#include "handsim/simulation/watch/tracking.h"

namespace handsim::simulation {

class Simulation;

struct RunOptions {
  std::filesystem::path out;   ///< folder for the run's files; made where it is missing
  int frames = 0;              ///< pictures over the run; 0: no OpenGL context is made
  bool pose_pictures = false;  ///< a picture at the end of every hold of a controlled scene, or every phase
                               ///< of a grasp or climb, in place of `frames`
  bool plots = false;          ///< of a controlled scene: plots/ by gnuplot
  /// Writes the run as it stands at this time [s], rounded to a step, as snapshot.bin.
  std::optional<double> snapshot_at;
  /// Goes on from this snapshot file: the tables and pictures are of the rest of the scene, the summary of
  /// all.
  std::optional<std::filesystem::path> from_snapshot;
  /// Ends the run once a grasped object has moved too far or is lost.
  bool stop_lost = false;
  /// What the hash of the states is to be (state_hash.h).
  std::optional<std::uint64_t> expected_hash;
  /// Draws in a process of its own (output/child.h): a lack of memory may end the drawing, and no more.
  bool draw_apart = false;
  /// Is called with the share done, 0..1, now and then.
  std::function<void(double)> progress;
  /// Is called before the run with what the user should know of it: that it writes much.
  std::function<void(const std::string&)> note;
};

struct RunResult {
  std::vector<Verdict> verdicts;
  std::optional<PhysicsFault> fault;  ///< of a run that diverged; the files are complete up to then
  double simulated = 0;               ///< [s]
  double wall = 0;                    ///< of the loop [s]
  std::string summary;                ///< text of summary.json
  std::vector<std::string> warnings;  ///< Simulation::warnings
  std::uint64_t state_hash = 0;
  std::optional<std::uint64_t> expected_hash;  ///< where one was given
  std::optional<double> continued_from;        ///< time of the snapshot that the run went on from [s]
  std::vector<AxisTracking> tracking;          ///< by driven axis; empty where the scene drives none
  std::vector<GraspFigures> grasps;            ///< of the scene's grasps
  std::vector<ClimbFigures> climbs;            ///< of the scene's climbs
  std::vector<engine::Overlap> overlaps;       ///< of shapes at the start

  /// What was asked for and is not there, with why: `pictures: ...`, `plots: ...`.
  std::vector<std::string> missing;

  bool hash_as_expected() const { return !expected_hash || *expected_hash == state_hash; }
  bool passed() const;
  bool judged() const;  ///< there is a criterion
  bool failed() const;  ///< some criterion's figure is beyond its limit
  bool missed() const;  ///< some criterion has no figure
};

/// Nothing is left to measure: every climb has failed, and the scene has no grasp; or, where asked for, a
/// grasped object is lost.
bool over(const Simulation& simulation, bool stop_lost);

/// Runs the scene and writes its files.
/// @throws Error (input) where the folder cannot be had (output_folder.h), the scene is too large to be
///         written down (inputs.h), the snapshot to go on from is no snapshot of this scene, or is not of a
///         time before its end, or where the files have no room (output_size.h); nothing is run then.
/// @throws Error (output) where a table or the summary cannot be written.
RunResult run(const scene::Scene& scene, const RunOptions& options);

/// The folder of a run, for a caller with several runs that checks all folders before the first run. @throws
/// Error (input) as OutputFolder does.
output::OutputFolder run_folder(const scene::Scene& scene, const RunOptions& options);
/// A run into a folder that is held already; null: it is taken for the time of the run.
RunResult run(const scene::Scene& scene, const RunOptions& options, const output::OutputFolder* folder);

/// The scene at a time [s] of its motion, 0 to its duration.
/// @throws Error (physics) where the simulation diverges before that.
Moment moment_at(const scene::Scene& scene, double time);

}  // namespace handsim::simulation
