#include "handsim/engine/ode/joint_kinds.h"

#include <algorithm>
#include <cmath>

#include "handsim/engine/spring.h"

namespace handsim::engine::ode {

using model::JointKind;

namespace {

/// A torque below this share of its limit is taken to stay within it in the next solution. Chosen.
constexpr double kWeakShare = 0.8;

void set_parameter(dJointID motor, bool slider, int parameter, double value) {
  if (slider)
    dJointSetLMotorParam(motor, parameter, value);
  else
    dJointSetAMotorParam(motor, parameter, value);
}

/// ODE's functions of a kind of joint; a ball joint has no parameters.
struct Calls {
  dJointID (*create)(dWorldID, dJointGroupID);
  void (*set_parameter)(dJointID, int, dReal);
};

/// In the order of JointKind.
constexpr Calls kCalls[] = {{dJointCreateHinge, dJointSetHingeParam},
                            {dJointCreateUniversal, dJointSetUniversalParam},
                            {dJointCreateBall, nullptr},
                            {dJointCreateSlider, dJointSetSliderParam}};

const Calls& calls(JointKind kind) { return kCalls[static_cast<std::size_t>(kind)]; }

Direction direction_of(double angle) { return {std::sin(angle), std::cos(angle)}; }

/// sin(b - a), times both factors.
double sin_between(const Direction& a, const Direction& b) { return b.sin * a.cos - b.cos * a.sin; }

}  // namespace

int ode_axis(JointKind kind, std::size_t axis) {
  return kind == JointKind::universal ? 1 - static_cast<int>(axis) : static_cast<int>(axis);
}

dJointID create_joint(dWorldID world, JointKind kind) { return calls(kind).create(world, nullptr); }

void set_parameter(dJointID id, JointKind kind, int parameter, double value) {
  if (calls(kind).set_parameter) calls(kind).set_parameter(id, parameter, value);
}

void set_geometry(dJointID id, const model::Joint& joint, const Pose& x_WF) {
  const auto set = [&](void (*call)(dJointID, dReal, dReal, dReal), const Vec3& v) {
    call(id, v.x(), v.y(), v.z());
  };
  const auto axis = [&](std::size_t i) -> Vec3 { return x_WF.q * joint.axes[i].axis; };
  switch (joint.kind) {
    case JointKind::hinge:
      set(dJointSetHingeAnchor, x_WF.p);
      return set(dJointSetHingeAxis, axis(0));
    case JointKind::universal:
      set(dJointSetUniversalAnchor, x_WF.p);
      set(dJointSetUniversalAxis1, axis(1));
      return set(dJointSetUniversalAxis2, axis(0));
    case JointKind::slider:
      return set(dJointSetSliderAxis, axis(0));
    case JointKind::ball:
      return set(dJointSetBallAnchor, x_WF.p);
  }
}

void add_torques(dJointID id, const model::Joint& joint, const double* tau, const model::State& state,
                 dBodyID child, dBodyID parent) {
  switch (joint.kind) {
    case JointKind::hinge:
      return dJointAddHingeTorque(id, tau[0]);
    case JointKind::universal:
      return dJointAddUniversalTorques(id, tau[1], tau[0]);
    case JointKind::slider:
      return dJointAddSliderForce(id, tau[0]);
    case JointKind::ball: {
      const Quat q_WF = state.bodies[as_index(joint.parent)].q * joint.parent_frame.q;
      const Vec3 torque = q_WF * Vec3(tau[0], tau[1], tau[2]);
      if (child) dBodyAddTorque(child, torque.x(), torque.y(), torque.z());
      if (parent) dBodyAddTorque(parent, -torque.x(), -torque.y(), -torque.z());
    }
  }
}

dJointID create_motor(dWorldID world, const model::Joint& joint, const std::vector<std::size_t>& axes,
                      dBodyID child, dBodyID parent) {
  const bool slider = joint.slides(axes.front());
  const dJointID motor = slider ? dJointCreateLMotor(world, nullptr) : dJointCreateAMotor(world, nullptr);
  dJointAttach(motor, child, parent);
  if (slider) {
    dJointSetLMotorNumAxes(motor, static_cast<int>(axes.size()));
  } else {
    dJointSetAMotorMode(motor, dAMotorUser);
    dJointSetAMotorNumAxes(motor, static_cast<int>(axes.size()));
  }
  return motor;
}

void set_motor_axes(dJointID motor, const model::Joint& joint, const std::vector<std::size_t>& axes,
                    bool parent_is_body, const Pose& x_WF) {
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const Vec3 a = x_WF.q * joint.axes[axes[i]].axis;
    // ODE: 0 fixed in the world, 1 in our child, 2 in our parent.
    const bool in_child = axes[i] > as_index(joint.type().slides);
    const int frame = in_child ? 1 : (parent_is_body ? 2 : 0);
    if (joint.slides(axes[i]))
      dJointSetLMotorAxis(motor, static_cast<int>(i), frame, a.x(), a.y(), a.z());
    else
      dJointSetAMotorAxis(motor, static_cast<int>(i), frame, a.x(), a.y(), a.z());
  }
}

void add_feedback(dJointFeedback& feedback, bool slides, std::span<const Vec3> axes, double* out) {
  dReal* on_child = slides ? feedback.f1 : feedback.t1;
  const Vec3 did(on_child[0], on_child[1], on_child[2]);
  on_child[0] = on_child[1] = on_child[2] = 0;
  const double a = axes[0].dot(did);
  if (axes.size() == 1) {
    out[0] += a;
    return;
  }
  // Perpendicular but for the joint's error.
  const double b = axes[1].dot(did), c = axes[0].dot(axes[1]), scale = 1 / (1 - c * c);
  out[0] += scale * (a - c * b);
  out[1] += scale * (b - c * a);
}

StopArc::StopArc(double low, double high)
    : low_(low),
      high_(high),
      low_end_(direction_of(low)),
      high_end_(direction_of(high)),
      narrow_(high - low < 3.1) {}

bool StopArc::reached(const Direction& at) const {
  if (narrow_) return !(sin_between(low_end_, at) > 0 && sin_between(at, high_end_) > 0);
  const double angle = at.angle();
  return angle <= low_ || angle >= high_;
}

void Servos::add(dJointID motor, const model::Joint& joint, const std::vector<std::size_t>& axes) {
  for (std::size_t i = 0; i < axes.size(); ++i) {
    Row row;
    row.motor = motor;
    row.group = kParamGroup * static_cast<int>(i);
    row.dof = static_cast<std::size_t>(joint.first_dof) + axes[i];
    row.slider = joint.slides(axes[i]);
    set_parameter(motor, row.slider, dParamFMax + row.group, 0);
    rows_.push_back(row);
  }
}

// A motor row obeys v+ + CFM lambda = vel with |lambda| <= fmax. With ERP and CFM of soft_row, vel = ERP / h
// error + CFM feed makes lambda = k (error - h v+) - c v+ + feed, the servo's law with its limit.
void Servos::set_compliance(Row& row, const model::Servo& servo) const {
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
  return std::ranges::any_of(
      rows_, [&](const Row& row) { return row.set_limit > row.limit && std::abs(tau[row.dof]) > row.limit; });
}

void Servos::set(std::span<const model::Servo> servos) {
  if (servos.empty() && at_rest_) return;
  for (Row& row : rows_) {
    const model::Servo servo = servos.empty() ? model::Servo{} : servos[row.dof];
    row.limit = servo.limit;
    set_limit(row, servo.limit);
    if (servo.limit == 0) continue;
    set_compliance(row, servo);
    set_parameter(row.motor, row.slider, dParamVel + row.group,
                  row.pull * servo.error + row.compliance * servo.feed);
  }
  at_rest_ = servos.empty();
}

}  // namespace handsim::engine::ode
