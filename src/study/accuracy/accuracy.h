// What accuracy costs: one scene, many methods, many steps. Each row has its errors against a reference and
// its price in CPU time, measured in the same process.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "handsim/core/yaml.h"
#include "handsim/scene/read/engine_choice.h"
#include "handsim/study/accuracy/peer_program.h"

namespace handsim::study {

/// What a row is compared with.
enum class Reference {
  slider_crank_iftomm,  ///< the exact reduction, from study/slider_crank_reference.h
  slider_crank_torque,
  method,         ///< the scene run with `reference_set`
  smallest_step,  ///< each method's own smallest step
};

/// A method of the study: overrides of the scene, as `key.path=value`.
struct AccuracyMethod {
  std::string name;
  std::vector<std::string> set;
  std::vector<double> steps;  ///< [s], falling
  std::optional<std::filesystem::path>
      scene;  ///< in place of the study's; then its own smallest step is the reference
  std::optional<std::string> observe;  ///< in place of the study's
  std::optional<PeerMethod> peer;      ///< another engine's, in place of the scene's solver
  /// Title of the line that plots of cost join it to: methods of one kind that differ in their tolerance,
  /// whose step is none of theirs. Absent: a line of its own.
  std::optional<std::string> line;
};

struct AccuracySpec {
  std::string title;
  std::filesystem::path scene;
  Reference reference = Reference::smallest_step;
  std::vector<std::string> reference_set;
  /// A joint, whose first coordinate is compared, or a body with `.x`, `.y` or `.z`; absent: all coordinates.
  std::optional<std::string> observe;
  double sample_every = 0.01;      ///< times at which rows and reference are compared [s]
  double early = 0.5;              ///< end of the early window [s]
  int repeats = 5;                 ///< timed runs of each row, of which the median counts
  std::vector<double> plot_steps;  ///< steps whose motion is plotted [s]
  std::vector<AccuracyMethod> methods;
  std::optional<scene::SceneKind> kind;  ///< of the scene, for the table that engine `auto` chooses from
  std::optional<std::filesystem::path>
      peers;  ///< folder of the peers' programs; absent: their rows are left out
};

/// Motion at the sample times.
struct Series {
  std::vector<double> time;                  ///< [s]
  std::vector<std::vector<double>> q, rate;  ///< observed coordinates less their start, and rates
};

struct AccuracyRow {
  std::string method;
  double step = 0;              ///< [s]
  bool own_reference = false;   ///< compared with its method's smallest step
  bool is_reference = false;    ///< its own smallest step: error 0 by definition
  double rate_error = 0;        ///< RMS over the whole run [m/s] or [rad/s]
  double early_rate_error = 0;  ///< RMS up to AccuracySpec::early
  double position_error = 0;    ///< RMS over the whole run [m] or [rad]
  double gap = 0;               ///< largest joint gap [m]
  std::optional<double>
      energy_error;           ///< largest energy imbalance over largest kinetic energy; where energy is kept
  double cpu_per_second = 0;  ///< CPU seconds for a simulated second
  std::optional<std::string> fault;  ///< why the row has no figures
  Series series;                     ///< kept for plot_steps

  double times_real_time() const { return 1 / cpu_per_second; }
};

struct AccuracyResult {
  std::vector<AccuracyRow> rows;
  std::optional<Series> reference;    ///< absent where every method is its own
  std::string unit;                   ///< of the coordinates: `m` or `rad`
  std::vector<std::string> left_out;  ///< methods of peers without a row, and why
  std::vector<std::string> engines;   ///< that have rows, each with its version
};

/// @throws Error (input) with every problem of the file.
AccuracySpec load_accuracy(const std::filesystem::path& path);

/// Costs are taken in rounds, each of which times every row once, so that what else the machine does falls on
/// all.
/// @param progress is called with the share done, 0..1.
/// @throws Error (input) where a scene or an override is bad.
AccuracyResult run_accuracy(const AccuracySpec& spec, const std::function<void(double)>& progress);

/// What the study measured of the methods of handsim's own, for engine `auto`: of each engine the rows that
/// no other row of it betters in both error and cost. @throws Error (input) where the study has no kind or no
/// reference.
scene::CostTable cost_table(const AccuracySpec& spec, const AccuracyResult& result);

/// The cheapest row whose whole-run error is at most `target`; nothing where none is. Where the study has a
/// reference, rows with one of their own do not compete.
const AccuracyRow* cheapest(const AccuracyResult& result, double target);

/// The rows as a table for the screen.
std::string accuracy_table(const AccuracyResult& result, double early);

/// The cheapest row for each of a ladder of errors, down to the smallest that any row reaches, as a table;
/// where one row is the cheapest for several, the smallest of them. Empty where no row reaches 0.1.
std::string cheapest_table(const AccuracyResult& result);

/// Writes accuracy.csv, accuracy.json and, where gnuplot is installed, error_cost, cost_step and velocity as
/// PNG and SVG.
/// @returns false where gnuplot is missing or failed; its script accuracy.gp is there all the same.
/// @throws Error (input) where the folder cannot be written.
bool write_accuracy(const AccuracySpec& spec, const AccuracyResult& result, const std::filesystem::path& out);
std::vector<std::string> accuracy_files();

}  // namespace handsim::study
