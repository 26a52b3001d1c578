// The accuracy study: errors relative to a reference, and CPU times, of many methods and steps on one scene.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "handsim/model/state.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::study {

/// The solution with which rows are compared.
enum class Reference {
  slider_crank_iftomm,  ///< exact, every 10 ms over 5 s
  slider_crank_torque,  ///< exact, every 10 ms over 2 s
  method,               ///< the scene run with `reference_set`
  smallest_step,        ///< each method's run with its smallest step
};

/// An engine that is not handsim's, as tests/peers runs some.
struct OutsideEngine {
  /// Simulates the scene's mechanism from its start over its duration; the second is called with the start
  /// and the state after every step. @return name and version
  std::function<std::string(const scene::Scene&, const std::function<void(const model::State&)>&)> simulate;
  /// CPU seconds of a number of steps from the start, after a warm-up and without output.
  std::function<double(const scene::Scene&, long)> cpu_seconds;
};

/// A method of the study: overrides of the scene, as `key.path=value`.
struct AccuracyMethod {
  std::string name;
  std::vector<std::string> set;
  std::vector<double> steps;  ///< [s], decreasing
  /// Replaces the study's scene; then the reference is the method's run with its smallest step.
  std::optional<std::filesystem::path> scene;
  std::optional<std::string> observe;    ///< replaces the study's
  std::optional<OutsideEngine> outside;  ///< used instead of the scene's solver
  /// Title of the line of the error-cost plot that shows this method together with others that differ only in
  /// their tolerance; such methods are left out of plots over the step. Absent: a line of its own.
  std::optional<std::string> line;
};

struct AccuracySpec {
  std::string title;
  std::filesystem::path scene;
  Reference reference = Reference::smallest_step;
  std::vector<std::string> reference_set;
  /// A joint (its first coordinate is compared) or a body with `.x`, `.y` or `.z`; absent: all coordinates.
  std::optional<std::string> observe;
  double sample_every = 0.01;      ///< times at which rows and reference are compared [s]
  double early = 0.5;              ///< end of the early window [s]
  int repeats = 5;                 ///< timed runs of each row; the row has their median
  std::vector<double> plot_steps;  ///< steps whose motion is plotted [s]
  std::vector<AccuracyMethod> methods;
};

/// Motion at the sample times.
struct Series {
  std::vector<double> time;                  ///< [s]
  std::vector<std::vector<double>> q, rate;  ///< observed coordinates relative to their start, and rates
};

struct AccuracyRow {
  std::string method;
  double step = 0;              ///< [s]
  bool own_reference = false;   ///< compared with the smallest step of its method
  bool is_reference = false;    ///< the smallest step of its method, used as reference: error 0 by definition
  double rate_error = 0;        ///< RMS over the whole run [m/s] or [rad/s]
  double early_rate_error = 0;  ///< RMS up to AccuracySpec::early
  double position_error = 0;    ///< RMS over the whole run [m] or [rad]
  double gap = 0;               ///< largest joint gap [m]
  /// Largest energy error over largest kinetic energy; absent for scenes that do not conserve energy.
  std::optional<double> energy_error;
  double cpu_per_second = 0;         ///< CPU seconds for a simulated second
  std::optional<std::string> fault;  ///< why the row has no figures
  Series series;                     ///< only for steps in plot_steps
  std::string command;               ///< repeats the run; empty: of an outside engine
};

struct AccuracyResult {
  std::vector<AccuracyRow> rows;
  std::optional<Series> reference;   ///< absent for Reference::smallest_step
  std::string unit;                  ///< of the coordinates: `m` or `rad`
  std::vector<std::string> engines;  ///< engines of the rows, with their versions
};

/// CPU seconds of so many steps from the start of a scene, after so many of another run that warm up. Nothing
/// is recorded.
double cpu_seconds(const scene::Scene& scene, long warm_up, long steps);

/// @throws Error (input) with every problem of the file.
AccuracySpec load_accuracy(const std::filesystem::path& path);

/// Costs are measured in rounds; each round times every row once, so that other load of the machine affects
/// all rows.
/// @param progress is called with the finished share, 0..1.
/// @throws Error (input) for an invalid scene or override.
AccuracyResult run_accuracy(const AccuracySpec& spec, const std::function<void(double)>& progress);

/// The rows, and of the study what their files need, as python/handsim/_accuracy.py reads them: JSON.
std::string rows_text(const AccuracySpec& spec, const AccuracyResult& result);

}  // namespace handsim::study
