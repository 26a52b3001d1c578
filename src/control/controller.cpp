#include "handsim/control/controller.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "handsim/core/error.h"

namespace handsim::control {

namespace {

/// Weight of the newest value in a first-order low-pass of this cut-off [Hz], backward Euler.
double smoothing(const std::optional<double>& cutoff, double step) {
  if (!cutoff) return 1;
  const double x = 2 * M_PI * *cutoff * step;
  return x / (1 + x);
}

}  // namespace

Controller::Controller(const model::Model& model, const Plan& plan, double step, const model::State& start)
    : plan_(plan), step_(step), axes_(plan.axes.size()) {
  const auto dofs = at(model.dof_count());
  (plan.form == Form::explicit_torque ? torques_.resize(dofs) : servos_.resize(dofs));
  std::size_t width = 0;
  for (const HandPlan& hand : plan.hands) {
    first_target_.push_back(width);
    width += hand.trajectory.width();
  }
  targets_.resize(width);
  if (plan.gravity) gravity_.emplace(model, *plan.gravity);
  if (plan.feed_forward) {
    const std::vector<double> still(width);
    feed_.emplace(FeedForward{
        model::NewtonEuler(model, plan.feed_gravity), still, still, {}, {}, std::vector<double>(dofs), {}});
  }
  constants_.reserve(plan.axes.size());
  for (std::size_t i = 0; i < plan.axes.size(); ++i) {
    const DrivenAxis& axis = plan.axes[i];
    const model::JointAxis& of_model = model.joints[axis.joint].axes[axis.axis];
    const model::Tissue tissue =
        plan.tissue_compensation ? of_model.tissue.value_or(model::Tissue{}) : model::Tissue{};
    constants_.push_back({axis.gains, axis.dof, first_target_[axis.hand] + axis.column, tissue.stiffness,
                          tissue.rest, tissue.damping, smoothing(axis.gains.derivative_cutoff, step),
                          axis.gains.integral_zone.value_or(std::numeric_limits<double>::infinity())});
  }
  memory_.integral.resize(axes_.size());
  memory_.filtered_rate.resize(axes_.size());
  update_targets(start.time);
  measure(start);
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    axes_[i].target = targets_[constants_[i].target];
    memory_.filtered_rate[i] = axes_[i].rate;
  }
}

void Controller::set_targets(std::span<const double> targets) {
  const bool finite = std::ranges::all_of(targets, [](double target) { return std::isfinite(target); });
  if (targets.size() != axes_.size() || !finite)
    throw input_error("targets", finite ? fmt::format("{} angles", targets.size()) : "one that is not finite",
                      fmt::format("a finite angle for each of {} driven axes", axes_.size()));
  given_.assign(targets.begin(), targets.end());
}

void Controller::update_targets(double time) {
  for (std::size_t i = 0; i < given_.size(); ++i) targets_[constants_[i].target] = given_[i];
  if (!given_.empty()) {
    // The caller's targets have no rates.
    if (feed_) std::ranges::fill(feed_->rates, 0.0);
    if (feed_) std::ranges::fill(feed_->accelerations, 0.0);
    return;
  }
  for (std::size_t h = 0; h < plan_.hands.size(); ++h) {
    const Trajectory& trajectory = plan_.hands[h].trajectory;
    const auto part = [&](std::vector<double>& of) {
      return std::span(of).subspan(first_target_[h], trajectory.width());
    };
    if (feed_)
      trajectory.at(time, part(targets_), part(feed_->rates), part(feed_->accelerations));
    else
      trajectory.at(time, part(targets_));
  }
}

/// Coordinates that are not driven move on at their measured rates.
void Controller::update_feed(const model::State& state) {
  FeedForward& feed = *feed_;
  feed.q = state.q;
  feed.u = state.u;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const AxisConstants& c = constants_[i];
    feed.q[c.dof] = targets_[c.target];
    feed.u[c.dof] = feed.rates[c.target];
    feed.change[c.dof] = feed.accelerations[c.target];
  }
  feed.dynamics.set_roots(state, state.time + step_);
  feed.dynamics.place(feed.q, feed.u, feed.change);
  feed.torques = feed.dynamics.torques();
}

void Controller::measure(const model::State& state) {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    axes_[i].angle = state.q[constants_[i].dof];
    axes_[i].rate = state.u[constants_[i].dof];
  }
}

template <class Archive, class Self>
void Controller::carry(Archive& archive, Self& self) {
  archive.each(self.memory_.integral);
  archive.each(self.memory_.filtered_rate);
  for (auto& axis : self.axes_) {
    for (auto* value : {&axis.angle, &axis.rate, &axis.target, &axis.torque}) archive(*value);
    archive(axis.at_limit);
  }
}

void Controller::save(ArchiveWriter& out) const { carry(out, *this); }

void Controller::restore(ArchiveReader& in) { carry(in, *this); }

/// Torque added to spring and damper: the integral, advanced by one step, and the feed-forward terms.
double Controller::offset_torque(std::size_t i, double target) {
  const AxisConstants& c = constants_[i];
  double& integral = memory_.integral[i];
  if (c.gains.integral > 0) {
    const double error = target - axes_[i].angle;
    const bool saturated = axes_[i].at_limit && error * axes_[i].torque > 0;
    if (!saturated && std::abs(error) < c.zone)
      integral = std::clamp(integral + step_ * c.gains.integral * error, -c.gains.torque_limit,
                            c.gains.torque_limit);
  }
  const double weight = gravity_torques_.empty() ? 0 : gravity_torques_[c.dof];
  const double tissue = c.tissue_stiffness * (target - c.tissue_rest);
  if (!feed_) return integral + weight + tissue;
  const double rate = feed_->rates[c.target];
  return integral + tissue + feed_->torques[c.dof] + (c.gains.derivative + c.tissue_damping) * rate;
}

void Controller::command_torques() {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const AxisConstants& c = constants_[i];
    AxisState& axis = axes_[i];
    const double target = targets_[c.target];
    double& rate = memory_.filtered_rate[i];
    rate += c.smoothing * (axis.rate - rate);
    const double torque =
        c.gains.proportional * (target - axis.angle) - c.gains.derivative * rate + offset_torque(i, target);
    axis.torque = std::clamp(torque, -c.gains.torque_limit, c.gains.torque_limit);
    axis.at_limit = std::abs(torque) >= c.gains.torque_limit;
    torques_[c.dof] = axis.torque;
  }
}

// The damping of a low-passed rate d+ = d + s (v+ - d) is s D on the rate after the step plus a known term.
void Controller::command_servos() {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const AxisConstants& c = constants_[i];
    const double target = targets_[c.target];
    model::Servo& servo = servos_[c.dof];
    servo.stiffness = c.gains.proportional;
    servo.damping = c.smoothing * c.gains.derivative;
    servo.error = target - axes_[i].angle;
    servo.feed = offset_torque(i, target) - (1 - c.smoothing) * c.gains.derivative * memory_.filtered_rate[i];
    servo.limit = c.gains.torque_limit;
  }
}

void Controller::command(const model::State& state) {
  update_targets(state.time + step_);
  if (gravity_) gravity_torques_ = gravity_->torques(state);
  if (feed_) update_feed(state);
  plan_.form == Form::explicit_torque ? command_torques() : command_servos();
}

void Controller::observe(const model::State& state) {
  measure(state);
  for (std::size_t i = 0; i < axes_.size(); ++i) axes_[i].target = targets_[constants_[i].target];
  if (plan_.form == Form::explicit_torque) return;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    AxisState& axis = axes_[i];
    const AxisConstants& c = constants_[i];
    axis.torque = state.tau_servo[c.dof];
    // A torque at its limit may be rounded below it.
    axis.at_limit = std::abs(axis.torque) >= c.gains.torque_limit * (1 - 1e-9);
    memory_.filtered_rate[i] += c.smoothing * (axis.rate - memory_.filtered_rate[i]);
  }
}

}  // namespace handsim::control
