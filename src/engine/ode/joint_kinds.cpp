#include "handsim/engine/ode/joint_kinds.h"

#include <cmath>

namespace handsim::engine::ode {

using model::JointKind;

int ode_axis(JointKind kind, std::size_t axis) {
  return kind == JointKind::universal ? 1 - static_cast<int>(axis) : static_cast<int>(axis);
}

namespace {

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

}  // namespace

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

dJointID create_motor(dWorldID world, JointKind kind, std::size_t count, dBodyID child, dBodyID parent) {
  const bool slider = kind == JointKind::slider;
  const dJointID motor = slider ? dJointCreateLMotor(world, nullptr) : dJointCreateAMotor(world, nullptr);
  dJointAttach(motor, child, parent);
  if (slider) {
    dJointSetLMotorNumAxes(motor, static_cast<int>(count));
  } else {
    dJointSetAMotorMode(motor, dAMotorUser);
    dJointSetAMotorNumAxes(motor, static_cast<int>(count));
  }
  return motor;
}

void set_motor_axes(dJointID motor, const model::Joint& joint, const std::vector<std::size_t>& axes,
                    bool parent_is_body, const Pose& x_WF) {
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const Vec3 a = x_WF.q * joint.axes[axes[i]].axis;
    // ODE: 0 fixed in the world, 1 in our child, 2 in our parent.
    const bool in_child = joint.kind == JointKind::universal && axes[i] == 1;
    const int frame = in_child ? 1 : (parent_is_body ? 2 : 0);
    if (joint.kind == JointKind::slider)
      dJointSetLMotorAxis(motor, static_cast<int>(i), frame, a.x(), a.y(), a.z());
    else
      dJointSetAMotorAxis(motor, static_cast<int>(i), frame, a.x(), a.y(), a.z());
  }
}

void add_feedback(dJointFeedback& feedback, JointKind kind, std::span<const Vec3> axes, double* out) {
  dReal* on_child = kind == JointKind::slider ? feedback.f1 : feedback.t1;
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

namespace {

Direction direction_of(double angle) { return {std::sin(angle), std::cos(angle)}; }

/// sin(b - a), times both factors.
double sin_between(const Direction& a, const Direction& b) { return b.sin * a.cos - b.cos * a.sin; }

}  // namespace

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

}  // namespace handsim::engine::ode
