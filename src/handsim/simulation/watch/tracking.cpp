#include "handsim/simulation/watch/tracking.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "handsim/simulation/watch/summary_json.h"

namespace handsim::simulation {

namespace {

/// The verdict on the worst axis, by `figures` of each; nothing measured where no axis has the figure.
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
  out["gains"] = {{"proportional_N_m_per_rad", axis.proportional},
                  {"derivative_N_m_s_per_rad", axis.derivative},
                  {"integral_N_m_per_rad_s", axis.integral},
                  {"torque_limit_N_m", axis.torque_limit},
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

Tracking::Tracking(const Watched& watched)
    : engine_(watched.engine),
      controller_(*watched.controller),
      by_muscles_(watched.scene.plans.control && watched.scene.plans.control->by_muscles),
      step_(watched.scene.spec.solver.step),
      axes_(controller_.axes().size()),
      figures_(controller_.axes().size()) {
  const control::Plan& plan = controller_.plan();
  std::size_t at = 0;
  for (std::size_t h = 0; h < plan.hands.size(); ++h) {
    Hand hand;
    hand.first = at;
    while (at < plan.axes.size() && plan.axes[at].hand == h) {
      figures_[at].name = plan.axes[at].name;
      ++at;
    }
    hand.last = at;
    hand.trajectory = &plan.hands[h].trajectory;
    // Skips movements that began before: where these started is not known.
    const std::vector<control::Phase>& phases = hand.trajectory->phases();
    while (hand.phase < phases.size() && phases[hand.phase].start < engine_.state().time - 0.5 * step_)
      ++hand.phase;
    hands_.push_back(hand);
  }
}

/// A movement goes from where the target stands to its pose.
void Tracking::begin_phase(Hand& hand) {
  const control::Phase& phase = hand.trajectory->phases()[hand.phase++];
  std::vector<double> from(hand.trajectory->width()), to(from.size());
  hand.trajectory->at(phase.start - 1e-9, from);
  hand.trajectory->at(phase.arrive + 1e-9, to);
  for (std::size_t i = hand.first; i < hand.last; ++i) {
    const std::size_t column = controller_.plan().axes[i].column;
    axes_[i].from = from[column];
    axes_[i].to = to[column];
    axes_[i].last_outside = phase.start;
    axes_[i].beyond = axes_[i].error_before = axes_[i].error_now = 0;
  }
  hand.moving = true;
  hand.window = phase.arrive;
}

void Tracking::end_phase(Hand& hand, double time) {
  hand.moving = false;
  const control::Phase& phase = hand.trajectory->phases()[hand.phase - 1];
  if (time < phase.arrive + step_) return;
  for (std::size_t i = hand.first; i < hand.last; ++i) {
    const Axis& axis = axes_[i];
    AxisTracking& out = figures_[i];
    out.steady_error.raise(std::max(axis.error_before, axis.error_now), time, phase.pose);
    ++out.holds;
    const double length = std::abs(axis.to - axis.from);
    if (length < control::kSmallestMovement) continue;
    ++out.movements;
    out.overshoot.raise(axis.beyond / length, phase.start, phase.pose);
    if (axis.last_outside > time - 1.5 * step_)
      ++out.unsettled;
    else
      out.settling_time.raise(axis.last_outside - phase.start, phase.start, phase.pose);
  }
}

/// The movement under way: what it overshoots, when it settles, how far off it is held.
void Tracking::follow(Hand& hand, double time) {
  const control::Phase& phase = hand.trajectory->phases()[hand.phase - 1];
  const bool next_window = time >= hand.window + kSteadyWindow;
  for (std::size_t i = hand.first; i < hand.last; ++i) {
    Axis& axis = axes_[i];
    const double length = axis.to - axis.from;
    const double left = axis.to - controller_.axes()[i].angle;
    if (std::abs(left) > kSettledShare * std::abs(length)) axis.last_outside = time;
    axis.beyond = std::max(axis.beyond, length > 0 ? -left : left);
    if (time < phase.arrive) continue;
    if (next_window) axis.error_before = std::exchange(axis.error_now, 0);
    axis.error_now = std::max(axis.error_now, std::abs(left));
  }
  if (next_window) hand.window = time;
}

void Tracking::update(Step& step) {
  const double time = step.engine.state().time;
  ++steps_;
  for (Hand& hand : hands_) {
    const std::vector<control::Phase>& phases = hand.trajectory->phases();
    for (std::size_t i = hand.first; i < hand.last; ++i) {
      const control::AxisState& now = controller_.axes()[i];
      Axis& axis = axes_[i];
      const double error = std::abs(now.target - now.angle);
      axis.square_sum += error * error;
      if (error > axis.largest) axis.largest = error, axis.largest_time = time;
      axis.torque = std::max(axis.torque, std::abs(now.torque));
      axis.at_limit += now.at_limit ? 1 : 0;
    }
    if (hand.moving) follow(hand, time);
    if (hand.moving && time >= phases[hand.phase - 1].end - 0.5 * step_) end_phase(hand, time);
    if (hand.phase < phases.size() && time >= phases[hand.phase].start - 0.5 * step_) begin_phase(hand);
  }
}

template <class Archive, class Self>
void Tracking::serialize(Archive& archive, Self& self) {
  archive(self.steps_);
  for (auto& axis : self.axes_)
    archive(axis.square_sum, axis.largest, axis.largest_time, axis.torque, axis.from, axis.to,
            axis.last_outside, axis.beyond, axis.error_before, axis.error_now, axis.at_limit);
  for (auto& hand : self.hands_) archive(hand.phase, hand.moving, hand.window);
  // Names are the scene's; what figures() derives is not kept.
  for (auto& figure : self.figures_) {
    for (auto* peak : {&figure.steady_error, &figure.overshoot, &figure.settling_time})
      simulation::serialize(archive, *peak);
    archive(figure.holds, figure.movements, figure.unsettled);
  }
}

void Tracking::save(ArchiveWriter& out) const { serialize(out, *this); }

void Tracking::restore(ArchiveReader& in, const model::State& /*state*/) {
  serialize(in, *this);
  for (const Hand& hand : hands_)
    if (hand.phase > hand.trajectory->phases().size() || (hand.moving && hand.phase == 0))
      in.refuse("a movement that is not in the program", "one of this scene's");
  for (const AxisTracking& figure : figures_)
    if (figure.unsettled > figure.movements || figure.movements > figure.holds)
      in.refuse("more movements than holds", "counts that agree");
}

std::vector<AxisTracking> Tracking::figures() const {
  Tracking closed = *this;
  for (Hand& hand : closed.hands_)
    if (hand.moving) closed.end_phase(hand, engine_.state().time);
  std::vector<AxisTracking> out = std::move(closed.figures_);
  const double n = steps_ > 0 ? static_cast<double>(steps_) : 1.0;
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i].rms_error = std::sqrt(axes_[i].square_sum / n);
    out[i].largest_error = {axes_[i].largest, axes_[i].largest_time, out[i].name};
    out[i].largest_torque = axes_[i].torque;
    out[i].limit_share = static_cast<double>(axes_[i].at_limit) / n;
  }
  return out;
}

const AxisTracking* Tracking::worst(const std::vector<AxisTracking>& axes) {
  const auto at = std::ranges::max_element(
      axes, [](const AxisTracking& a, const AxisTracking& b) { return a.rms_error < b.rms_error; });
  return at == axes.end() ? nullptr : &*at;
}

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
  out.push_back(fmt::format(
      "the muscles do not follow their targets: RMS error {:.3g} deg over all axes, {:.3g} deg at {}. "
      "Without control.controller the scene has controllers/muscles.yaml, which is made for muscles",
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
