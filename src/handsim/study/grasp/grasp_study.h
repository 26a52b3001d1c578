// Many grasp and climb scenes in one table of each: each is run with its files, on either hand, and where
// asked the smallest friction that still holds a grasp is searched for.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "handsim/output/output_folder.h"
#include "handsim/simulation/run/run.h"

namespace handsim::study {

struct GraspStudy {
  std::vector<std::filesystem::path>
      scenes;                      ///< files, or folders: every scene in them with grasps or climbs
  std::vector<std::string> sides;  ///< `right`, `left` for the first hand; empty: as the scene has it
  std::vector<std::filesystem::path>
      persons;                         ///< files, or folders of them, of the first hand; empty: the scene's
  std::vector<std::string> overrides;  ///< `key.path=value`, for every scene
  std::optional<double> friction;      ///< of every surface; absent: the scene's
  bool friction_search = false;
  bool margin = false;    ///< each grasp again with 5 % more and less friction and mass
  bool confirm = false;   ///< each grasp again at half the step
  bool pictures = false;  ///< at every phase
  /// Video of each run; its file is a name without a folder, because it is written into the run's folder.
  std::optional<simulation::VideoSpec> video;
  std::optional<output::Gl> gl;  ///< as RunOptions
  bool draw_apart = false;       ///< as RunOptions
  std::filesystem::path out;
  /// Told the share done, 0..1.
  std::function<void(double)> progress;
};

/// A row of the table: one run.
struct RunRow {
  std::string scene;                    ///< file name without extension
  std::string side;                     ///< of the hand
  bool passed = false;                  ///< every criterion of the run held
  double simulated = 0, wall = 0;       ///< [s]
  std::string fault;                    ///< where the run diverged
  double stature = 0, hand_length = 0;  ///< of the person [m]
  double grip_strength = 0;             ///< the person's own, or the norm [N]
};

struct ClimbRow : RunRow {
  simulation::ClimbFigures figures;
};

struct GraspRow : RunRow {
  simulation::GraspFigures figures;
  std::optional<double>
      smallest_friction;               ///< that still holds, of every surface, to a sixtieth of the scene's
  std::string not_searched;            ///< why there is none
  std::optional<std::string> turning;  ///< what of the 5 % turns the verdict; empty: nothing does
  std::optional<simulation::GraspFigures> half_step;  ///< with `confirm`: the same at half the step

  /// The step decides: the outcome at half of it is another one, or its margin differs by more than there is
  /// at either. An error in proportion to the step is at half of it still as large as the difference.
  bool uncertain() const;
};

/// A grasp or climb that does not fit its hand: nothing is run.
struct RefusedGrasp {
  std::string scene, side;
  std::string why;
};

struct GraspTables {
  std::vector<GraspRow> grasps;
  std::vector<ClimbRow> climbs;
  std::vector<RefusedGrasp> refused;             ///< with `persons` only; without, they are errors of input
  std::vector<std::string> missing;              ///< `OUT/SCENE: pictures: ...`, see RunResult
  std::unique_ptr<output::OutputFolder> folder;  ///< of the study, for its other files
};

/// JSON of the rows of all tables, in SI, and of what is missing.
std::string rows_text(const GraspTables& tables);

/// Runs the study and writes OUT/SCENE_SIDE/ for each run.
/// @throws Error (input) for what is no scene with grasps or climbs, before anything is run.
GraspTables run_grasps(const GraspStudy& study);

/// A scene, side and person of the study, of which uncertain hands can be drawn: a study of rollouts.
struct UncertainGrasp {
  std::string name, side;
  std::filesystem::path file;
  std::vector<std::string> overrides;
  std::filesystem::path out;
};

/// @param refused what does not fit its hand. @throws Error (input) as run_grasps
std::vector<UncertainGrasp> uncertain_grasps(const GraspStudy& study, std::vector<RefusedGrasp>& refused);

/// Gives every surface of a scene, and of its resolved.yaml, one friction; moments about normals go with it.
void set_friction(scene::Scene& scene, double friction);

/// Gives the grasped objects of a compiled scene another mass and inertia, the same share of all.
void scale_object_mass(scene::Scene& scene, double factor);

/// Runs a scene without files until it ends, diverges, or a grasp is decided.
std::vector<simulation::GraspFigures> simulate(const scene::Scene& scene);

/// The first of 5 % less friction, more mass, more friction and less mass that turns whether all grasps of a
/// scene are held; empty: none. @param is_held whether they are; @param told the share done, 0..1.
std::string turning(const scene::Scene& scene, bool is_held, const std::function<void(double)>& told = {});

/// Bisects the smallest friction of every surface with which all grasps of the scene are held; nothing where
/// its own friction does not hold them. @param told the share done, 0..1.
std::optional<double> smallest_friction(const scene::Scene& scene,
                                        const std::function<void(double)>& told = {});

}  // namespace handsim::study
