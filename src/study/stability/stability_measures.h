// What hard cases are judged by. A measure looks at a simulation after every step and ends in a figure; a
// procedure makes runs of its own and compares them. Both are found by name in one table.
#pragma once

#include <functional>
#include <limits>
#include <memory>
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
  double from = 0;                                         ///< start of the span that is looked at [s]
  double until = std::numeric_limits<double>::infinity();  ///< its end [s]
  std::optional<double> expected;                          ///< closed form of the figure [SI]
  double crank = 0, rod = 0;                               ///< lengths of a slider-crank [m]
  double crank_angle = 0;                                  ///< from the slider's axis at the start [rad]
  std::vector<double> steps;                               ///< ladder of a procedure [s]
  std::vector<std::string> set;  ///< overrides of the run that a procedure compares with
};

/// A figure, and where and when it was met.
struct Figure {
  double value = 0;
  std::optional<double> time;  ///< [s]
  std::string where;
  /// What a procedure found it from, for plots: a ladder of steps [s] and errors.
  std::vector<std::pair<double, double>> curve = {};
};

class Measure {
 public:
  virtual ~Measure() = default;
  /// Sees the start, and the state after every step.
  virtual void look(const simulation::Simulation& now) = 0;
  /// Nothing where the run never came to what is measured.
  virtual std::optional<Figure> figure() const = 0;
  /// Present value, for plots.
  virtual std::optional<double> course() const { return std::nullopt; }
};

/// Makes scenes of a case with its overrides and more.
using SceneMaker = std::function<scene::Scene(const std::vector<std::string>& more)>;

/// What a measure has to be told.
struct MeasureNeeds {
  bool body = false, joint = false, steps = false, set = false, crank = false;
};
inline constexpr MeasureNeeds kNeedsBody = {.body = true};

struct MeasureKind {
  std::string_view name;
  std::string_view what;  ///< in words
  Dimension dimension = Dimension::none;
  std::string_view unit;
  bool at_least = false;  ///< the limit is a lower one
  MeasureNeeds needs;
  /// Of a run; null for a procedure. The scene outlives the measure.
  std::unique_ptr<Measure> (*make)(const scene::Scene& scene, const MeasureSpec& spec) = nullptr;
  /// Makes runs of its own; null for a measure. @throws Error (physics) where one goes wrong.
  Figure (*procedure)(const SceneMaker& scene, const MeasureSpec& spec) = nullptr;
};

std::span<const MeasureKind> measure_kinds();
/// Null where there is none of this name.
const MeasureKind* measure_kind(std::string_view name);

}  // namespace handsim::study
