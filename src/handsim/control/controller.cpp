#include "handsim/control/controller.h"

#include <algorithm>
#include <cmath>

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
    : plan_(plan), step_(step), driven_(plan.axes), axes_(plan.axes.size()) {
  const auto dofs = as_index(model.dof_count());
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
  for (const DrivenAxis& axis : plan.axes) {
    const model::JointAxis& of_model = model.joints[axis.joint].axes[axis.axis];
    tissue_.push_back(plan.tissue_compensation ? of_model.tissue.value_or(model::Tissue{}) : model::Tissue{});
    smoothing_.push_back(smoothing(axis.derivative_cutoff, step));
  }
  update_targets(start.time);
  measure(start);
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    axes_[i].target = target(i);
    axes_[i].filtered_rate = axes_[i].rate;
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
  for (std::size_t i = 0; i < given_.size(); ++i) targets_[target_index(plan_.axes[i])] = given_[i];
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
  for (const DrivenAxis& axis : plan_.axes) {
    const std::size_t target = target_index(axis);
    feed.q[axis.dof] = targets_[target];
    feed.u[axis.dof] = feed.rates[target];
    feed.change[axis.dof] = feed.accelerations[target];
  }
  feed.dynamics.set_roots(state, state.time + step_);
  feed.dynamics.place(feed.q, feed.u, feed.change);
  feed.torques = feed.dynamics.torques();
}

void Controller::measure(const model::State& state) {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    axes_[i].angle = state.q[plan_.axes[i].dof];
    axes_[i].rate = state.u[plan_.axes[i].dof];
  }
}

template <class Archive, class Self>
void Controller::serialize(Archive& archive, Self& self) {
  for (auto& axis : self.axes_)
    archive(axis.angle, axis.rate, axis.target, axis.torque, axis.at_limit, axis.integral,
            axis.filtered_rate);
}

void Controller::save(ArchiveWriter& out) const { serialize(out, *this); }

void Controller::restore(ArchiveReader& in) { serialize(in, *this); }

/// Torque added to spring and damper: the integral, advanced by one step, and the feed-forward terms.
double Controller::offset_torque(std::size_t i, double target) {
  const DrivenAxis& axis = driven_[i];
  AxisState& now = axes_[i];
  if (axis.integral > 0) {
    const double error = target - now.angle;
    const bool saturated = now.at_limit && error * now.torque > 0;
    if (!saturated && (!axis.integral_zone || std::abs(error) < *axis.integral_zone))
      now.integral =
          std::clamp(now.integral + step_ * axis.integral * error, -axis.torque_limit, axis.torque_limit);
  }
  const model::Tissue& tissue = tissue_[i];
  const double weight = gravity_torques_.empty() ? 0 : gravity_torques_[axis.dof];
  const double pull = tissue.stiffness * (target - tissue.rest);
  if (!feed_) return now.integral + weight + pull;
  const double rate = feed_->rates[target_index(axis)];
  return now.integral + pull + feed_->torques[axis.dof] + (axis.derivative + tissue.damping) * rate;
}

void Controller::command_torques() {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const DrivenAxis& axis = driven_[i];
    AxisState& now = axes_[i];
    const double goal = target(i);
    now.filtered_rate += smoothing_[i] * (now.rate - now.filtered_rate);
    const double torque =
        axis.proportional * (goal - now.angle) - axis.derivative * now.filtered_rate + offset_torque(i, goal);
    now.torque = std::clamp(torque, -axis.torque_limit, axis.torque_limit);
    now.at_limit = std::abs(torque) >= axis.torque_limit;
    torques_[axis.dof] = now.torque;
  }
}

// The damping of a low-passed rate d+ = d + s (v+ - d) is s D on the rate after the step plus a known term.
void Controller::command_servos() {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const DrivenAxis& axis = driven_[i];
    const double goal = target(i);
    model::Servo& servo = servos_[axis.dof];
    servo.stiffness = axis.proportional;
    servo.damping = smoothing_[i] * axis.derivative;
    servo.error = goal - axes_[i].angle;
    servo.feed = offset_torque(i, goal) - (1 - smoothing_[i]) * axis.derivative * axes_[i].filtered_rate;
    servo.limit = axis.torque_limit;
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
  for (std::size_t i = 0; i < axes_.size(); ++i) axes_[i].target = target(i);
  if (plan_.form == Form::explicit_torque) return;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    AxisState& axis = axes_[i];
    axis.torque = state.tau_servo[plan_.axes[i].dof];
    // A torque at its limit may be rounded below it.
    axis.at_limit = std::abs(axis.torque) >= driven_[i].torque_limit * (1 - 1e-9);
    axis.filtered_rate += smoothing_[i] * (axis.rate - axis.filtered_rate);
  }
}

}  // namespace handsim::control
