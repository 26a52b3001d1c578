// ODE's calls for a joint of the model, one function for all kinds of joint: ODE has other names for each.
// And servo drives as rows of motors beside the joints, so that a joint's own stops stay alive (a motor and a
// stop in one ODE joint share one row, and the motor's force drives the joint off its stop: see the README).
#pragma once

#include <span>
#include <vector>

#include <ode/ode.h>

#include "handsim/engine/ode/bodies.h"
#include "handsim/model/actuation.h"
#include "handsim/model/angle_sensor.h"
#include "handsim/model/model.h"

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

/// Adds torques or forces along a joint's coordinates to its bodies. @param parent, child null if none
void add_torques(dJointID id, const model::Joint& joint, const double* tau, const model::State& state,
                 dBodyID child, dBodyID parent);

/// A motor on axes of a joint, which all slide or all turn, between its bodies: LMotor or AMotor.
dJointID create_motor(dWorldID world, const model::Joint& joint, const std::vector<std::size_t>& axes,
                      dBodyID child, dBodyID parent);

/// Axes of a joint's motor, in the same configuration.
void set_motor_axes(dJointID motor, const model::Joint& joint, const std::vector<std::size_t>& axes,
                    bool parent_is_body, const Pose& x_WF);

/// Adds what a motor did along its one or two axes: x with sum of x_k axis_k = its torque on the child
/// [N m], of a slider its force [N]. Clears the feedback, which ODE leaves for a motor without a row.
void add_feedback(dJointFeedback& feedback, bool slides, std::span<const Vec3> axes, double* out);

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

class Servos {
 public:
  /// @param step of the engine [s].
  explicit Servos(double step) : step_(step) {}

  /// Drives coordinates of a joint by a motor on their axes.
  void add(dJointID motor, const model::Joint& joint, const std::vector<std::size_t>& axes);
  /// Sets the rows of the next step. @param servos size model.dof_count(), or empty: none acts.
  void set(std::span<const model::Servo> servos);
  /// In the next solution rows whose torque is far below its limit have no limit, for a faster direct solver.
  /// @param tau of the step before [N m] or [N], size model.dof_count(); empty: all have their limits
  void relax(std::span<const double> tau);
  /// True if a torque is beyond its limit. @param tau of the last solution, the servos'
  bool beyond_limits(std::span<const double> tau) const;

 private:
  /// One coordinate: its motor, and what the row was last told.
  struct Row {
    dJointID motor = nullptr;
    int group = 0;  ///< parameter group of its axis
    std::size_t dof = 0;
    bool slider = false;
    double stiffness = 0, damping = 0, limit = 0;
    double set_limit = 0;   ///< of the ODE row
    double pull = 0;        ///< speed asked per error [1/s]
    double compliance = 0;  ///< speed asked per torque of feed
  };
  void set_compliance(Row& row, const model::Servo& servo) const;
  static void set_limit(Row& row, double limit);

  double step_;
  std::vector<Row> rows_;
  bool at_rest_ = true;  ///< no row acts
};

}  // namespace handsim::engine::ode
