// The hand against measurements: quantities of a built hand (arms, excursions, forces, moments, masses)
// beside measured values and their spread, rows of a file such as config/validate.yaml.
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/hand/build.h"
#include "handsim/study/study_run.h"
#include "handsim/study/uncertain.h"

namespace handsim::study {

/// What a row measures on the hand.
enum class Measured {
  moment_arms,      ///< mean of a muscle's arm about an axis over angles [m]
  excursion,        ///< of a muscle's tendon from one pose to another [m]
  tip_force_share,  ///< force of a fingertip held in force and moment, per tension of muscles [1]
  tip_force,        ///< largest force of a fingertip in a direction [N]
  pinch_force,      ///< largest force between thumb and a finger [N]
  grip_force,       ///< largest force of fingers that press an object to the palm [N]
  joint_moment,     ///< largest isometric moment of muscles about an axis [N m]
  passive_moment,   ///< of tissue and resting muscles about an axis, other joints at rest [N m]
  loaded_rotation,  ///< of an axis, from rest to where a loaded tendon, tissue and resting muscles balance
                    ///< [rad]
  coupled_angle,  ///< of an axis where tissue, bands and resting muscles balance, others held at a pose; with
                  ///< a finger all its axes may turn [rad]
  pulley_force,   ///< on A2 or A4, for a tension of the deep flexor at a PIP angle (model/pulleys.h) [N]
  sheath_friction,  ///< share of a yielding finger's force that a shortening one has less, by the sheath [1]
  hand_mass,        ///< [kg]
  centre_of_mass,   ///< of the hand from the wrist, share of hand length [1]
  gyration,         ///< radius of the hand about an axis, share of hand length [1]
  simulation,       ///< a number of the summary of a scene's run, in the summary's own unit
};

/// Its word in files.
std::string_view kind_name(Measured kind);

/// On whom a row was measured; a model is another hand model, or a published formula.
enum class MeasuredOn { people, cadavers, model };
/// Whose a row's spread is: the source's for this very quantity, or chosen here.
enum class SpreadIs { source, chosen };
/// How the hand's value relates to the row.
enum class ValueIs {
  fitted,    ///< a number of the hand is fitted to it, or to the same quantity of another source
  norm,      ///< a norm by sex, age or stature, beside a hand whose strength is such a norm
  scaled,    ///< a value that no number is fitted to, of a person whose strength is a norm's
  predicted  ///< none of these
};
inline constexpr std::array kMeasuredOn = {"people", "cadavers", "model"};
inline constexpr std::array kSpreadIs = {"source", "chosen"};
inline constexpr std::array kValueIs = {"fitted", "norm", "scaled", "predicted"};

using Angles = std::map<std::string, double>;  ///< by axis [rad]

struct Measurement {
  std::string name, unit, source, reason;
  Measured kind = Measured::moment_arms;
  MeasuredOn on = MeasuredOn::people;
  SpreadIs spread_is = SpreadIs::source;
  ValueIs value_is = ValueIs::fitted;
  std::string chosen;  ///< which of the row's conditions are not the source's; empty: none
  std::string person;
  std::string hand;                     ///< of ValidateSpec::hands; empty: that of the file
  std::optional<std::size_t> over_row;  ///< row above, whose value divides this one's
  std::string muscle, axis, finger, direction;
  std::string
      segment;  ///< tip_force: whose middle is pressed; empty: the fingertip. pulley_force: the pulley
  std::vector<std::string> muscles;
  std::vector<std::string> balanced;  ///< forces: axes without a moment; joint_moment: then of all muscles
  /// grip_force: from the palm's normal towards the fingers, of the line along which the object is pressed to
  /// the palm; the strongest counts [rad]
  std::vector<double> tilts;
  std::vector<double> angles, arms;  ///< moment_arms: [rad], [m]
  Angles pose, from;
  std::vector<Angles> or_poses;      ///< beside `pose`: the largest value counts
  std::optional<Angles> over_pose;   ///< forces and moments: a pose whose value divides that of `pose`
  std::filesystem::path scene;       ///< simulation, grip_force
  std::vector<std::string> changes;  ///< of the scene: `key.path=value`
  /// simulation: paths in summary.json (`climbs.0.load_N`) whose numbers or vectors, by length, are added
  std::vector<std::string> figures;
  std::vector<std::string> over;      ///< simulation: figures whose sum divides it; empty: none
  double friction = 0;                ///< of forces: of the surface; 0: force without shear
  double tension = 0;                 ///< pulley_force [N]
  double load = 0;                    ///< loaded_rotation: share of the muscle's force
  std::optional<double> hand_length;  ///< of the measured hand: lengths of ours are scaled to it [m]
  double value = 0, spread = 0;
  double scale = 1;  ///< of the printed unit
  bool required = false;
  /// Its hand is a scene's, not one of `people`.
  bool has_scene() const { return kind == Measured::simulation || kind == Measured::grip_force; }
  /// Of people, with the spread and the conditions of the source.
  bool is_of_people() const {
    return on == MeasuredOn::people && spread_is == SpreadIs::source && chosen.empty();
  }
  bool is_predicted() const { return value_is == ValueIs::predicted; }
};

struct ValidateSpec {
  std::string title;
  hand::HandSpec hand;
  std::map<std::string, hand::HandSpec> hands;  ///< the same, changed (hand/what_if.h)
  const hand::HandSpec& hand_of(const Measurement& row) const {
    return row.hand.empty() ? hand : hands.at(row.hand);
  }
  std::map<std::string, hand::Person> people;
  std::vector<Measurement> measurements;
  double goal = 0.9;  ///< share of rows within one spread
};

struct ValidateRow {
  const Measurement* of = nullptr;
  double ours = 0;
  double deviation = 0;                    ///< over the spread; moment_arms: root mean square over the angles
  bool measured = true;                    ///< false: a simulation that was not run
  double weight = 1;                       ///< one over the rows that this value serves
  std::optional<Uncertainty> uncertainty;  ///< of drawn hands
  bool inside = false;  ///< the measured value is within the middle 90 % of drawn hands, its spread added
  bool within() const { return measured && deviation <= 1; }
};

/// Measured values of some rows: how many there are, and how many of them are within. A value that serves
/// several rows counts once, within by the part of these rows that it is within.
struct Tally {
  double within = 0, values = 0;
  double share() const { return values > 0 ? within / values : 0; }
};
using RowFilter = std::function<bool(const Measurement&)>;

struct ValidateResult {
  std::vector<ValidateRow> rows;
  /// Values within one spread, of measured rows.
  Tally within(const RowFilter& of) const;
  /// Rows with drawn hands that are `inside`.
  Tally covered(const RowFilter& of) const;
  /// True if every required row that was measured is within its spread.
  bool passed() const;
};

/// Reads a file of measurements. @throws Error (input) with every problem
ValidateSpec load_validate(const std::filesystem::path& path);
void read_validate(const YamlNode& root, Diagnostics& diagnostics);
/// @param runs folder for the files of simulations; absent: these rows are not measured
/// @param uncertain hands drawn of each person, for rows that are no simulations
ValidateResult run_validate(const ValidateSpec& spec, const std::optional<std::filesystem::path>& runs = {},
                            std::optional<int> uncertain = {},
                            const std::function<void(double)>& progress = {});
std::string validate_table(const ValidateSpec& spec, const ValidateResult& result);
std::string validate_csv(const ValidateResult& result);
/// Writes validate.csv, validate.json, and a plot of the differences over the spreads by kind. @return false
/// if gnuplot is missing or fails @throws Error if the files cannot be written
bool write_validate(const ValidateSpec& spec, const ValidateResult& result, const std::filesystem::path& out);

struct ValidateOptions {
  std::optional<std::filesystem::path> file;  ///< of measurements; absent: the installed ones
  bool runs = false;                          ///< also runs the rows that are simulations
  std::optional<int> uncertain;               ///< hands drawn of each person
};
/// The whole study. @param run an empty folder: no files @throws Error (input) as its parts
StudyEnd validate(const ValidateOptions& options, const StudyRun& run);

}  // namespace handsim::study
