#include "handsim/control/controller.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "handsim/core/error.h"

namespace handsim::control {

namespace {

/// Share of the newest value in a first-order low-pass of this cut-off [Hz], backward Euler.
double smoothing(const std::optional<double>& cutoff, double step) {
  if (!cutoff) return 1;
  const double x = 2 * M_PI * *cutoff * step;
  return x / (1 + x);
}

}  // namespace

Controller::Controller(const model::Model& model, const Plan& plan, double step, const model::State& start)
    : plan_(plan), step_(step), axes_(plan.axes.size()) {
  const auto dofs = static_cast<std::size_t>(model.dof_count());
  (plan.form == Form::explicit_torque ? torques_.resize(dofs) : servos_.resize(dofs));
  std::size_t width = 0;
  for (const HandPlan& hand : plan.hands) {
    first_target_.push_back(width);
    width += hand.trajectory.width();
  }
  targets_.resize(width);
  if (plan.gravity) load_.emplace(model, *plan.gravity);
  for (std::size_t i = 0; i < plan.axes.size(); ++i) {
    const DrivenAxis& axis = plan.axes[i];
    const model::JointAxis& of_model = model.joints[axis.joint].axes[axis.axis];
    Law law{axis.gains,
            axis.dof,
            first_target_[axis.hand] + axis.column,
            0,
            0,
            smoothing(axis.gains.derivative_cutoff, step),
            axis.gains.integral_zone.value_or(std::numeric_limits<double>::infinity())};
    if (plan.tissue_compensation && of_model.tissue) {
      law.tissue_stiffness = of_model.tissue->stiffness;
      law.tissue_rest = of_model.tissue->rest;
    }
    laws_.push_back(law);
  }
  memory_.integral.resize(axes_.size());
  memory_.filtered_rate.resize(axes_.size());
  update_targets(start.time);
  sense(start);
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    axes_[i].target = targets_[laws_[i].target];
    memory_.filtered_rate[i] = axes_[i].rate;
  }
}

void Controller::set_targets(std::span<const double> targets) {
  const bool finite =
      std::all_of(targets.begin(), targets.end(), [](double target) { return std::isfinite(target); });
  if (targets.size() != axes_.size() || !finite)
    throw input_error("targets", finite ? fmt::format("{} angles", targets.size()) : "one that is not finite",
                      fmt::format("a finite angle for each of {} driven axes", axes_.size()));
  given_.assign(targets.begin(), targets.end());
}

void Controller::update_targets(double time) {
  for (std::size_t i = 0; i < given_.size(); ++i) targets_[laws_[i].target] = given_[i];
  if (!given_.empty()) return;
  for (std::size_t h = 0; h < plan_.hands.size(); ++h) {
    const Trajectory& trajectory = plan_.hands[h].trajectory;
    trajectory.at(time, std::span(targets_).subspan(first_target_[h], trajectory.width()));
  }
}

void Controller::sense(const model::State& state) {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    axes_[i].angle = state.q[laws_[i].dof];
    axes_[i].rate = state.u[laws_[i].dof];
  }
}

template <class Archive, class Self>
void Controller::carry(Archive& archive, Self& self) {
  archive.each(self.memory_.integral);
  archive.each(self.memory_.filtered_rate);
  for (auto& axis : self.axes_) {
    archive(axis.angle);
    archive(axis.rate);
    archive(axis.target);
    archive(axis.torque);
    archive(axis.at_limit);
  }
}

void Controller::save(ArchiveWriter& out) const { carry(out, *this); }

void Controller::restore(ArchiveReader& in) { carry(in, *this); }

/// What is added to spring and damper: the integral, moved on by one step, and what is fed forward.
double Controller::feed(std::size_t i, double target) {
  const Law& law = laws_[i];
  double& integral = memory_.integral[i];
  if (law.gains.integral > 0) {
    const double error = target - axes_[i].angle;
    const bool pushes_on = axes_[i].at_limit && error * axes_[i].torque > 0;
    if (!pushes_on && std::abs(error) < law.zone)
      integral = std::clamp(integral + step_ * law.gains.integral * error, -law.gains.torque_limit,
                            law.gains.torque_limit);
  }
  const double weight = weight_.empty() ? 0 : weight_[law.dof];
  return integral + weight + law.tissue_stiffness * (target - law.tissue_rest);
}

void Controller::drive_explicit() {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const Law& law = laws_[i];
    AxisState& axis = axes_[i];
    const double target = targets_[law.target];
    double& rate = memory_.filtered_rate[i];
    rate += law.smoothing * (axis.rate - rate);
    const double wanted =
        law.gains.proportional * (target - axis.angle) - law.gains.derivative * rate + feed(i, target);
    axis.torque = std::clamp(wanted, -law.gains.torque_limit, law.gains.torque_limit);
    axis.at_limit = std::abs(wanted) >= law.gains.torque_limit;
    torques_[law.dof] = axis.torque;
  }
}

// A low-passed rate d+ = d + s (v+ - d) splits into damping s D on the rate after the step and a known rest.
void Controller::drive_implicit() {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const Law& law = laws_[i];
    const double target = targets_[law.target];
    model::Servo& servo = servos_[law.dof];
    servo.stiffness = law.gains.proportional;
    servo.damping = law.smoothing * law.gains.derivative;
    servo.error = target - axes_[i].angle;
    servo.feed = feed(i, target) - (1 - law.smoothing) * law.gains.derivative * memory_.filtered_rate[i];
    servo.limit = law.gains.torque_limit;
  }
}

void Controller::command(const model::State& state) {
  update_targets(state.time + step_);
  if (load_) weight_ = load_->torques(state);
  switch (plan_.form) {
    case Form::explicit_torque:
      return drive_explicit();
    case Form::implicit_gain:
      return drive_implicit();
  }
}

void Controller::observe(const model::State& state) {
  sense(state);
  for (std::size_t i = 0; i < axes_.size(); ++i) axes_[i].target = targets_[laws_[i].target];
  if (plan_.form == Form::explicit_torque) return;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    AxisState& axis = axes_[i];
    const Law& law = laws_[i];
    axis.torque = state.tau_servo[law.dof];
    // Rounding must not hide the limit.
    axis.at_limit = std::abs(axis.torque) >= law.gains.torque_limit * (1 - 1e-9);
    memory_.filtered_rate[i] += law.smoothing * (axis.rate - memory_.filtered_rate[i]);
  }
}

}  // namespace handsim::control
