// What Tracking says of a run: its verdicts and its part of the summary.
#include "handsim/simulation/watch/summary_json.h"
#include "handsim/simulation/watch/tracking.h"

namespace handsim::simulation {

namespace {

using Figure = std::optional<Peak> (*)(const AxisTracking& axis);

/// The worst axis of a figure; nothing measured where no axis has it.
Verdict worst_of(const std::vector<AxisTracking>& axes, const char* name, const char* unit, Figure figure,
                 std::optional<double> limit) {
  Verdict verdict{name, unit, {}, limit, 0, ""};
  for (const AxisTracking& axis : axes) {
    const std::optional<Peak> peak = figure(axis);
    if (!peak || (verdict.measured && peak->value <= *verdict.measured)) continue;
    verdict.measured = peak->value;
    verdict.time = peak->time;
    verdict.where =
        peak->where.empty() || peak->where == axis.name ? axis.name : axis.name + " (" + peak->where + ")";
  }
  return verdict;
}

std::optional<Peak> where(bool exists, const Peak& peak) {
  return exists ? std::optional(peak) : std::nullopt;
}

Json peak_json(const Peak& peak, const char* key) {
  return {{key, peak.value}, {"time_s", peak.time}, {"pose", peak.where}};
}

Json axis_json(const control::DrivenAxis& axis, const AxisTracking& figures) {
  Json out = {{"name", axis.name}};
  out["gains"] = {{"proportional_N_m_per_rad", axis.gains.proportional},
                  {"derivative_N_m_s_per_rad", axis.gains.derivative},
                  {"integral_N_m_per_rad_s", axis.gains.integral},
                  {"torque_limit_N_m", axis.gains.torque_limit},
                  {"effective_inertia_kg_m2", axis.inertia}};
  out["rms_error_rad"] = figures.rms_error;
  out["largest_error"] = {{"rad", figures.largest_error.value}, {"time_s", figures.largest_error.time}};
  out["steady_error"] = figures.holds > 0 ? peak_json(figures.steady_error, "rad") : Json();
  out["overshoot"] = figures.movements > 0 ? peak_json(figures.overshoot, "share") : Json();
  out["settling_time"] =
      figures.movements > figures.unsettled ? peak_json(figures.settling_time, "s") : Json();
  out["holds"] = figures.holds;
  out["movements"] = figures.movements;
  out["unsettled"] = figures.unsettled;
  out["largest_torque_N_m"] = figures.largest_torque;
  out["share_at_torque_limit"] = figures.limit_share;
  return out;
}

}  // namespace

/// The worst axis of each figure.
void Tracking::add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const {
  const scene::TrackingCriteria& limits = criteria.tracking;
  const std::vector<AxisTracking> all = figures();
  if (all.empty()) return;
  const auto add = [&](const char* name, const char* unit, Figure figure, std::optional<double> limit) {
    out.push_back(worst_of(all, name, unit, figure, limit));
  };
  using A = const AxisTracking&;
  add(
      "rms_error", "rad",
      [](A a) {
        return where(true, {a.rms_error, 0, a.name});
      },
      limits.rms_error);
  out.back().time = engine_.state().time;
  add(
      "largest_error", "rad", [](A a) { return where(true, a.largest_error); }, limits.largest_error);
  add(
      "steady_error", "rad", [](A a) { return where(a.holds > 0, a.steady_error); }, limits.steady_error);
  add(
      "overshoot", "", [](A a) { return where(a.movements > 0, a.overshoot); }, limits.overshoot);
  add(
      "settling_time", "s", [](A a) { return where(a.movements > a.unsettled, a.settling_time); },
      limits.settling_time);
  Verdict unsettled{"unsettled", "", 0, {}, 0, ""};
  // A movement that never settles has no settling time: where that is judged, none may be left.
  if (limits.settling_time) unsettled.limit = 0;
  for (const AxisTracking& axis : all) *unsettled.measured += axis.unsettled;
  out.push_back(unsettled);
}

void Tracking::add_summary(SummaryJson& out) const {
  const control::Plan& plan = controller_.plan();
  const std::vector<AxisTracking> all = figures();
  const AxisTracking* worst_axis = worst(all);
  Json& control = out.json["control"];
  control["worst_joint"] = worst_axis ? Json(worst_axis->name) : Json();
  control["joints"] = Json::array();
  for (std::size_t i = 0; i < all.size(); ++i) control["joints"].push_back(axis_json(plan.axes[i], all[i]));
}

}  // namespace handsim::simulation
