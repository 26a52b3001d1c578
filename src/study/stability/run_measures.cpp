// Measures of hard cases: what a run keeps of itself, and what it costs the process.
#include <array>
#include <fstream>

#include "handsim/study/stability/measure_tools.h"

namespace handsim::study {

namespace {

using simulation::Peak;
using simulation::Simulation;

/// Growth of the process' resident memory from a tenth of the run on, as a share.
class Memory final : public Measure {
 public:
  void look(const Simulation& now) override {
    constexpr long kEvery = 1000;
    const long tenth = now.step_count() / 10;
    if (looks_++ < tenth || looks_ % kEvery != 0) return;
    const double now_pages = pages();
    if (!first_) first_ = now_pages;
    last_ = (now_pages - *first_) / *first_;
    largest_.book(last_, now.state().time);
  }
  std::optional<Figure> figure() const override { return largest_.figure(); }
  std::optional<double> course() const override { return first_ ? std::optional(last_) : std::nullopt; }

 private:
  static double pages() {
    std::ifstream file("/proc/self/statm");
    double all = 0, resident = 0;
    file >> all >> resident;
    return resident;
  }
  long looks_ = 0;
  std::optional<double> first_;
  double last_ = 0;
  Largest largest_;
};

/// What the simulation keeps anyway, read at the end.
class Kept final : public Measure {
 public:
  using Read = std::optional<Figure> (*)(const Simulation&);
  explicit Kept(Read read) : read_(read) {}
  void look(const Simulation& now) override { now_ = &now; }
  std::optional<Figure> figure() const override { return now_ ? read_(*now_) : std::nullopt; }
  std::optional<double> course() const override {
    const auto figure = now_ ? read_(*now_) : std::nullopt;
    return figure ? std::optional(figure->value) : std::nullopt;
  }

 private:
  Read read_;
  const Simulation* now_ = nullptr;
};

template <Kept::Read read>
std::unique_ptr<Measure> make_kept(const scene::Scene&, const MeasureSpec&) {
  return std::make_unique<Kept>(read);
}

std::optional<Figure> of_peak(const Peak& peak) { return Figure{peak.value, peak.time, peak.where}; }
std::optional<Figure> completes(const Simulation&) { return Figure{}; }
std::optional<Figure> joint_gap(const Simulation& now) {
  return of_peak(now.get<simulation::Monitor>().joint_gap());
}
std::optional<Figure> stop_overshoot(const Simulation& now) {
  return of_peak(now.get<simulation::Monitor>().stop_overshoot());
}
std::optional<Figure> stop_rest(const Simulation& now) {
  return of_peak(now.get<simulation::Monitor>().stop_rest(now.state()));
}
std::optional<Figure> lcp_failures(const Simulation& now) {
  return Figure{static_cast<double>(now.get<simulation::Convergence>().lcp_failures()), std::nullopt, ""};
}
std::optional<Figure> steady_error(const Simulation& now) {
  std::optional<Figure> out;
  for (const simulation::AxisTracking& axis : now.figures<simulation::Tracking>())
    if (axis.holds > 0 && (!out || axis.steady_error.value > out->value))
      out = {axis.steady_error.value, axis.steady_error.time, axis.name};
  return out;
}

/// The worst of the scene's grasps.
template <double simulation::GraspFigures::*field>
std::optional<Figure> of_grasps(const Simulation& now) {
  std::optional<Figure> out;
  for (const simulation::GraspFigures& grasp : now.figures<simulation::Grasps>())
    if (grasp.complete && (!out || grasp.*field > out->value)) out = {grasp.*field, std::nullopt, grasp.name};
  return out;
}
std::optional<Figure> grasp_epsilon(const Simulation& now) {
  std::optional<Figure> out;
  for (const simulation::GraspFigures& grasp : now.figures<simulation::Grasps>())
    if (grasp.complete && (!out || grasp.after.wrenches.epsilon < out->value))
      out = {grasp.after.wrenches.epsilon, std::nullopt, grasp.name};
  return out;
}

using D = Dimension;

const std::array kRunMeasures = {
    MeasureKind{"completes", "the run ends without a fault", D::none, "", false, {}, make_kept<completes>},
    MeasureKind{"joint_gap", "largest gap of any joint", D::length, "m", false, {}, make_kept<joint_gap>},
    MeasureKind{"stop_overshoot",
                "largest overshoot of a stop beyond impact rate times step",
                D::angle,
                "rad",
                false,
                {},
                make_kept<stop_overshoot>},
    MeasureKind{"stop_rest",
                "largest overshoot of a stop at the end",
                D::angle,
                "rad",
                false,
                {},
                make_kept<stop_rest>},
    MeasureKind{
        "lcp_failures", "times that the solver gave up", D::none, "", false, {}, make_kept<lcp_failures>},
    MeasureKind{
        "steady_error", "largest error of a held pose", D::angle, "rad", false, {}, make_kept<steady_error>},
    MeasureKind{"grasp_slip",
                "mean drift of a grasped object in the palm",
                D::speed,
                "m/s",
                false,
                {},
                make_kept<of_grasps<&simulation::GraspFigures::slip>>},
    MeasureKind{"grasp_shift",
                "movement of a grasped object in the palm by the shake",
                D::length,
                "m",
                false,
                {},
                make_kept<of_grasps<&simulation::GraspFigures::shift>>},
    MeasureKind{"grasp_turn",
                "turn of a grasped object in the palm by the shake",
                D::angle,
                "rad",
                false,
                {},
                make_kept<of_grasps<&simulation::GraspFigures::turn>>},
    MeasureKind{"grasp_epsilon",
                "smallest wrench that breaks the grasp (Ferrari and Canny)",
                D::none,
                "",
                true,
                {},
                make_kept<grasp_epsilon>},
    MeasureKind{"memory_growth",
                "growth of resident memory from a tenth of the run on, as a share",
                D::none,
                "",
                false,
                {},
                make_of_scene<Memory>}};

}  // namespace

std::span<const MeasureKind> run_measures() { return kRunMeasures; }

}  // namespace handsim::study
