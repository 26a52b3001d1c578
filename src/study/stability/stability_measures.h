// What hard cases are judged by. A measure samples a simulation after every step and reduces the samples to a
// figure; a procedure makes runs of its own and compares them. Both are found by name in one table.
#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "handsim/core/units.h"
#include "handsim/simulation/simulation.h"

namespace handsim::study {

/// A measure as a case asks for it.
struct MeasureSpec {
  std::string kind;                                        ///< of the table
  std::string name;                                        ///< of its rows; the kind where none is given
  double limit = 0;                                        ///< SI
  std::string body;                                        ///< whose motion is meant; empty: all that move
  std::string joint;                                       ///< whose coordinate is meant
  double from = 0;                                         ///< start of the measured span [s]
  double until = std::numeric_limits<double>::infinity();  ///< its end [s]
  std::optional<double> expected;                          ///< closed form of the figure [SI]
  double crank = 0, rod = 0;                               ///< lengths of a slider-crank [m]
  double crank_angle = 0;                                  ///< from the slider's axis at the start [rad]
  std::vector<double> steps;                               ///< ladder of a procedure [s]
  std::vector<std::string> set;  ///< overrides of the run that a procedure compares with
};

/// A figure, and where and when it was found.
struct Figure {
  double value = 0;
  std::string where = {};
  std::optional<double> time = {};  ///< [s]
  /// Of a procedure, for plots: a ladder of steps [s] and errors.
  std::vector<std::pair<double, double>> curve = {};
  /// Of a sample: the run's figure is divided by the largest scale of the run.
  double scale = 1;
};

/// The value at the present step; nothing where there is nothing to measure.
using Sampler = std::function<std::optional<Figure>(const simulation::Simulation& now)>;

/// How samples become the figure of a run.
enum class Reduce {
  largest,
  last,
  total,   ///< the last one, without a time: it sums up the run
  at_end,  ///< sampled at the end alone, with a time of its own
};

/// Makes scenes of a case with its overrides and more.
using SceneMaker = std::function<scene::Scene(const std::vector<std::string>& more)>;

/// Settings that a measure cannot do without.
struct MeasureNeeds {
  bool body = false, joint = false, steps = false, set = false, crank = false;
};

struct MeasureKind {
  std::string_view name;
  Dimension dimension = Dimension::none;
  std::string_view unit;
  Reduce reduce = Reduce::largest;
  /// Of a run; null for a procedure. The scene outlives the sampler.
  Sampler (*make)(const scene::Scene& scene, const MeasureSpec& spec) = nullptr;
  MeasureNeeds needs = {};
  /// Makes runs of its own; null for a measure. @throws Error (physics) where one fails.
  Figure (*procedure)(const SceneMaker& scene, const MeasureSpec& spec) = nullptr;
  bool at_least = false;  ///< the limit is a lower one
};

/// A measure of one run.
class Measure {
 public:
  /// Of the kind that the settings name, which is no procedure. The scene must outlive the measure.
  /// @throws Error (input) where the scene lacks what the settings name.
  Measure(const scene::Scene& scene, const MeasureSpec& spec);

  /// Samples the start, and the state after every step.
  void update(const simulation::Simulation& now);
  /// Nothing where the run had nothing to measure.
  std::optional<Figure> figure() const;
  /// Present value, for plots.
  std::optional<double> course() const;

 private:
  Reduce reduce_;
  Sampler sample_;
  const simulation::Simulation* now_ = nullptr;
  std::optional<Figure> kept_;
  double scale_ = 0;
  std::optional<double> last_;
};

std::span<const MeasureKind> measure_kinds();
/// Null where there is none of this name.
const MeasureKind* measure_kind(std::string_view name);

}  // namespace handsim::study
