// What Tracking reports of a run: its verdicts and its part of the summary.
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/units.h"
#include "handsim/simulation/watch/summary_json.h"
#include "handsim/simulation/watch/tracking.h"

namespace handsim::simulation {

namespace {

/// The verdict on the worst axis; nothing measured where no axis has the figure.
/// @param figures of each axis
Verdict worst_of(const std::vector<AxisTracking>& axes, const std::vector<std::optional<Peak>>& figures,
                 Verdict verdict) {
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const std::optional<Peak>& peak = figures[i];
    if (!peak || (verdict.measured && peak->value <= *verdict.measured)) continue;
    const std::string& axis = axes[i].name;
    verdict.measured = peak->value;
    verdict.time = peak->time;
    verdict.where = peak->where.empty() || peak->where == axis ? axis : axis + " (" + peak->where + ")";
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
  const double now = engine_.state().time;
  std::vector<std::optional<Peak>> rms, largest, steady, overshoot, settling;
  Verdict unsettled{"unsettled", "", 0};
  for (const AxisTracking& axis : all) {
    rms.push_back(Peak{axis.rms_error, now});
    largest.push_back(axis.largest_error);
    steady.push_back(where(axis.holds > 0, axis.steady_error));
    overshoot.push_back(where(axis.movements > 0, axis.overshoot));
    settling.push_back(where(axis.movements > axis.unsettled, axis.settling_time));
    *unsettled.measured += axis.unsettled;
  }
  out.push_back(worst_of(all, rms, {"rms_error", "rad", {}, limits.rms_error}));
  out.push_back(worst_of(all, largest, {"largest_error", "rad", {}, limits.largest_error}));
  out.push_back(worst_of(all, steady, {"steady_error", "rad", {}, limits.steady_error}));
  out.push_back(worst_of(all, overshoot, {"overshoot", "", {}, limits.overshoot}));
  out.push_back(worst_of(all, settling, {"settling_time", "s", {}, limits.settling_time}));
  // A movement that never settles has no settling time: where that is judged, none may be left.
  if (limits.settling_time) unsettled.limit = 0;
  out.push_back(unsettled);
}

void Tracking::add_warnings(std::vector<std::string>& out) const {
  const std::vector<AxisTracking> all = figures();
  const AxisTracking* worst_axis = worst(all);
  if (!by_muscles_ || !worst_axis) return;
  double squares = 0;
  for (const AxisTracking& axis : all) squares += axis.rms_error * axis.rms_error;
  const double rms = std::sqrt(squares / static_cast<double>(all.size()));
  if (rms <= kLostTargets) return;
  out.push_back(
      fmt::format("the muscles do not follow their targets: RMS error {:.3g} deg over all axes, {:.3g} deg "
                  "at {}. Without "
                  "control.controller the scene has controllers/muscles.yaml, which is made for muscles",
                  kDegreesPerRadian * rms, kDegreesPerRadian * worst_axis->rms_error, worst_axis->name));
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
