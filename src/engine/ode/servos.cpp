#include "handsim/engine/ode/servos.h"

#include <algorithm>
#include <cmath>

#include "handsim/engine/ode/joint_kinds.h"
#include "handsim/engine/spring.h"

namespace handsim::engine::ode {

namespace {

/// A torque below this share of its limit is taken to stay within it in the next solution. Chosen.
constexpr double kWeakShare = 0.8;

void set_parameter(dJointID motor, bool slider, int parameter, double value) {
  if (slider)
    dJointSetLMotorParam(motor, parameter, value);
  else
    dJointSetAMotorParam(motor, parameter, value);
}

}  // namespace

void Servos::set_step(double step) {
  step_ = step;
  for (Row& row : rows_) row.compliance = 0;
}

void Servos::add(dJointID motor, const model::Joint& joint) {
  for (std::size_t i = 0; i < joint.axes.size(); ++i) {
    Row row;
    row.motor = motor;
    row.group = kParamGroup * static_cast<int>(i);
    row.dof = static_cast<std::size_t>(joint.first_dof) + i;
    row.slider = joint.kind == model::JointKind::slider;
    set_parameter(motor, row.slider, dParamFMax + row.group, 0);
    rows_.push_back(row);
  }
}

// A motor row obeys v+ + CFM lambda = vel with |lambda| <= fmax. With ERP and CFM of soft_row,
// vel = ERP / h error + CFM feed makes lambda = k (error - h v+) - c v+ + feed, the servo's law, limit
// included.
void Servos::soften(Row& row, const model::Servo& servo) const {
  if (servo.stiffness != row.stiffness || servo.damping != row.damping || row.compliance == 0) {
    const SoftRow soft = soft_row(servo.stiffness, servo.damping, step_);
    row.pull = soft.erp / step_;
    row.compliance = soft.cfm;
    set_parameter(row.motor, row.slider, dParamCFM + row.group, soft.cfm);
  }
  row.stiffness = servo.stiffness;
  row.damping = servo.damping;
}

void Servos::set_limit(Row& row, double limit) {
  if (limit != row.set_limit) set_parameter(row.motor, row.slider, dParamFMax + row.group, limit);
  row.set_limit = limit;
}

void Servos::relax(std::span<const double> tau) {
  for (Row& row : rows_) {
    const bool weak = !tau.empty() && std::abs(tau[row.dof]) < kWeakShare * row.limit;
    set_limit(row, weak ? dInfinity : row.limit);
  }
}

bool Servos::beyond_limits(std::span<const double> tau) const {
  return std::any_of(rows_.begin(), rows_.end(), [&](const Row& row) {
    return row.set_limit > row.limit && std::abs(tau[row.dof]) > row.limit;
  });
}

void Servos::set(std::span<const model::Servo> servos) {
  if (servos.empty() && at_rest_) return;
  for (Row& row : rows_) {
    const model::Servo servo = servos.empty() ? model::Servo{} : servos[row.dof];
    row.limit = servo.limit;
    set_limit(row, servo.limit);
    if (servo.limit == 0) continue;
    soften(row, servo);
    set_parameter(row.motor, row.slider, dParamVel + row.group,
                  row.pull * servo.error + row.compliance * servo.feed);
  }
  at_rest_ = servos.empty();
}

}  // namespace handsim::engine::ode
