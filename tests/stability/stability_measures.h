// The measures of hard cases: each samples a simulation after every step and reduces the samples to a figure.
#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "handsim/core/index.h"
#include "handsim/core/units.h"
#include "handsim/simulation/simulation.h"

namespace handsim::study {

/// A measure with its settings in a case.
struct MeasureSpec {
  std::string kind;   ///< name in the table
  std::string name;   ///< name of its rows; by default the kind
  double limit = 0;   ///< SI
  std::string body;   ///< body to measure; empty: all that are not kinematic
  std::string joint;  ///< joint to measure
  double from = 0;    ///< start of the measured span [s]
  double until = std::numeric_limits<double>::infinity();  ///< its end [s]
  std::optional<double> expected;                          ///< closed form of the figure [SI]
  double crank = 0, rod = 0;                               ///< lengths of a slider-crank [m]
  double crank_angle = 0;                                  ///< from the slider's axis at the start [rad]
};

/// A figure with its place and time.
struct Figure {
  double value = 0;
  std::string where = {};
  std::optional<double> time = {};  ///< [s]
  /// Of a sample: the run's figure is divided by the largest scale of the run.
  double scale = 1;
};

/// Nothing if there is nothing to measure.
using Sample = std::optional<Figure>;
/// The value at the present step.
using Sampler = std::function<Sample(const simulation::Simulation& now)>;

/// How samples become a run's figure. `total`: the last, without a time; `at_end`: sampled once, with one.
enum class Reduce { largest, last, total, at_end };

struct MeasureKind {
  std::string_view name;
  Dimension dimension = Dimension::none;
  std::string_view unit;
  Reduce reduce = Reduce::largest;
  /// Makes the sampler of a run. The scene outlives the sampler.
  Sampler (*make)(const scene::Scene& scene, const MeasureSpec& spec) = nullptr;
  std::string_view needs = {};  ///< keys that it requires: `joint body crank rod`
  bool at_least = false;        ///< true for a lower limit
};

/// A measure of one run.
class Measure {
 public:
  /// The scene must outlive the measure.
  /// @throws Error (input) if the scene lacks a body or joint of the settings.
  Measure(const scene::Scene& scene, const MeasureSpec& spec);

  /// To be called at the start and after every step.
  void update(const simulation::Simulation& now);
  /// Nothing if the run had nothing to measure.
  std::optional<Figure> figure() const;

 private:
  Reduce reduce_;
  Sampler sample_;
  const simulation::Simulation* now_ = nullptr;
  std::optional<Figure> kept_;
  double scale_ = 0;
};

std::span<const MeasureKind> measure_kinds();
/// Null if there is none of this name.
const MeasureKind* measure_kind(std::string_view name);

/// True if the present time is within the measured span.
bool within(const MeasureSpec& spec, const simulation::Simulation& now);

/// Replaces the figure if the value is larger.
void keep_larger(std::optional<Figure>& figure, double value, const std::string& where);

/// Index of a body. @throws Error (input) if the scene has none of this name.
std::size_t body_of(const scene::Scene& scene, const std::string& name);
/// The body that the settings name, or all that are not kinematic.
std::vector<std::size_t> bodies_of(const scene::Scene& scene, const MeasureSpec& spec);

/// A joint coordinate; values in rad or m.
struct Coordinate {
  const model::Joint* joint = nullptr;
  std::size_t axis = 0;

  double value(const model::State& state) const { return state.q[as_index(joint->first_dof) + axis]; }
  double rate(const model::State& state) const { return state.u[as_index(joint->first_dof) + axis]; }
};

/// @param name `joint` or `joint.axis`. @throws Error (input) if the scene has none of this name.
Coordinate coordinate_of(const scene::Scene& scene, const std::string& name);

std::span<const MeasureKind> motion_measures();
std::span<const MeasureKind> joint_measures();

}  // namespace handsim::study
