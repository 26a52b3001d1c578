// Measures of hard cases: figures of the simulation's monitors, and the memory of the process.
#include <fstream>

#include "handsim/study/stability/measure_tools.h"

namespace handsim::study {

namespace {

using simulation::Peak;
using simulation::Simulation;
using Sample = std::optional<Figure>;

/// Relative growth of the resident memory of the process after the first tenth of the run.
Sampler memory_growth(const scene::Scene&, const MeasureSpec&) {
  return [first = std::optional<double>()](const Simulation& now) mutable -> Sample {
    constexpr long kEvery = 1000;
    if (now.steps() < now.step_count() / 10 || (now.steps() + 1) % kEvery != 0) return {};
    std::ifstream file("/proc/self/statm");
    double all = 0, resident = 0;
    file >> all >> resident;
    if (!first) first = resident;
    return {{(resident - *first) / *first}};
  };
}

/// A figure of the simulation's monitors, read at the end.
template <Sample (*read)(const Simulation&)>
Sampler at_end(const scene::Scene&, const MeasureSpec&) {
  return read;
}

Sample of_peak(const Peak& peak) { return Figure{peak.value, peak.where, peak.time}; }
Sample completes(const Simulation&) { return Figure{}; }
Sample joint_gap(const Simulation& now) { return of_peak(now.get<simulation::Monitor>().joint_gap()); }
Sample stop_overshoot(const Simulation& now) {
  return of_peak(now.get<simulation::Monitor>().stop_overshoot());
}
Sample stop_rest(const Simulation& now) {
  return of_peak(now.get<simulation::Monitor>().stop_rest(now.state()));
}
Sample lcp_failures(const Simulation& now) {
  return Figure{static_cast<double>(now.get<simulation::Convergence>().lcp_failures())};
}
Sample steady_error(const Simulation& now) {
  Sample out;
  for (const simulation::AxisTracking& axis : now.figures<simulation::Tracking>())
    if (axis.holds > 0 && (!out || axis.steady_error.value > out->value))
      out = {axis.steady_error.value, axis.name, axis.steady_error.time};
  return out;
}

/// The largest value among the scene's grasps.
template <double simulation::GraspFigures::*field>
Sample of_grasps(const Simulation& now) {
  Sample out;
  for (const simulation::GraspFigures& grasp : now.figures<simulation::Grasps>())
    if (grasp.complete) keep_larger(out, grasp.*field, grasp.name);
  return out;
}
Sample grasp_epsilon(const Simulation& now) {
  Sample out;
  for (const simulation::GraspFigures& grasp : now.figures<simulation::Grasps>())
    if (grasp.complete && (!out || grasp.after.wrenches.epsilon < out->value))
      out = {grasp.after.wrenches.epsilon, grasp.name};
  return out;
}

using D = Dimension;
using Grasp = simulation::GraspFigures;
constexpr Reduce kEnd = Reduce::at_end;

const MeasureKind kRunMeasures[] = {
    // name, dimension, unit, reduce, make, needs
    {"completes", D::none, "", kEnd, at_end<completes>},
    {"joint_gap", D::length, "m", kEnd, at_end<joint_gap>},
    {"stop_overshoot", D::angle, "rad", kEnd, at_end<stop_overshoot>},
    {"stop_rest", D::angle, "rad", kEnd, at_end<stop_rest>},
    {"lcp_failures", D::none, "", kEnd, at_end<lcp_failures>},
    {"steady_error", D::angle, "rad", kEnd, at_end<steady_error>},
    {"grasp_slip", D::speed, "m/s", kEnd, at_end<of_grasps<&Grasp::slip>>},
    {"grasp_shift", D::length, "m", kEnd, at_end<of_grasps<&Grasp::shift>>},
    {"grasp_turn", D::angle, "rad", kEnd, at_end<of_grasps<&Grasp::turn>>},
    {"grasp_epsilon", D::none, "", kEnd, at_end<grasp_epsilon>, kNothing, nullptr, true},
    {"memory_growth", D::none, "", Reduce::largest, memory_growth}};

}  // namespace

std::span<const MeasureKind> run_measures() { return kRunMeasures; }

}  // namespace handsim::study
