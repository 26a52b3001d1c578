#include "handsim/engine/ode/servos.h"

#include "handsim/engine/ode/joint_kinds.h"
#include "handsim/engine/spring.h"

namespace handsim::engine::ode {

namespace {

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

void Servos::set(std::span<const model::Servo> servos) {
  if (servos.empty() && at_rest_) return;
  for (Row& row : rows_) {
    const model::Servo servo = servos.empty() ? model::Servo{} : servos[row.dof];
    if (servo.limit != row.limit) {
      set_parameter(row.motor, row.slider, dParamFMax + row.group, servo.limit);
      row.limit = servo.limit;
    }
    if (servo.limit == 0) continue;
    soften(row, servo);
    set_parameter(row.motor, row.slider, dParamVel + row.group,
                  row.pull * servo.error + row.compliance * servo.feed);
  }
  at_rest_ = servos.empty();
}

}  // namespace handsim::engine::ode
