// ODE's calls for a joint of the model, one function for all kinds of joint: ODE has other names for each.
#pragma once

#include <span>
#include <vector>

#include "handsim/engine/ode/bodies.h"
#include "handsim/model/angle_sensor.h"

namespace handsim::engine::ode {

/// From one of ODE's parameters to the same of the next axis.
inline constexpr int kParamGroup = dParamLoStop2 - dParamLoStop;

/// ODE's number (0 or 1) of one of our axes.
int ode_axis(model::JointKind kind, std::size_t axis);

dJointID create_joint(dWorldID world, model::JointKind kind);

/// @param parameter with the axis's group; of a ball nothing is set
void set_parameter(dJointID id, model::JointKind kind, int parameter, double value);

/// Anchor and axes of a joint whose bodies stand in its zero configuration. @param x_WF the joint's frame
void set_geometry(dJointID id, const model::Joint& joint, const Pose& x_WF);

/// A motor with `count` axes between the bodies of a joint: AMotor, or LMotor of a slider.
dJointID create_motor(dWorldID world, model::JointKind kind, std::size_t count, dBodyID child,
                      dBodyID parent);

/// Axes of a joint's motor, in the same configuration.
void set_motor_axes(dJointID motor, const model::Joint& joint, const std::vector<std::size_t>& axes,
                    bool parent_is_body, const Pose& x_WF);

/// Adds what a motor did along a joint's one or two axes: x with sum of x_k axis_k = its torque on the child
/// [N m], of a slider its force [N]. Clears the feedback: ODE leaves that of a motor without a row in a step
/// as it was.
void add_feedback(dJointFeedback& feedback, model::JointKind kind, std::span<const Vec3> axes, double* out);

using model::Direction;

/// A stop as an arc, which an angle reaches to the last bit of its sine and cosine.
class StopArc {
 public:
  StopArc(double low, double high);
  /// True at or beyond an end of the arc, ends included, as ODE decides it.
  bool reached(const Direction& at) const;
  double low() const { return low_; }    ///< [rad]
  double high() const { return high_; }  ///< [rad]

 private:
  double low_, high_;
  Direction low_end_, high_end_;
  bool narrow_;  ///< spans less than half a turn
};

}  // namespace handsim::engine::ode
