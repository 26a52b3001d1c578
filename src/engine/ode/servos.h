// Servo drives as rows of motors beside the joints, so that a joint's own stops stay alive (a motor and a
// stop in one ODE joint share one row, and the motor's force drives the joint off its stop: see the README).
#pragma once

#include <span>
#include <vector>

#include <ode/ode.h>

#include "handsim/model/actuation.h"
#include "handsim/model/model.h"

namespace handsim::engine::ode {

class Servos {
 public:
  /// @param step of the engine [s].
  explicit Servos(double step) : step_(step) {}

  void set_step(double step);
  /// Drives a joint's coordinates by a motor whose axes are the joint's, in their order.
  void add(dJointID motor, const model::Joint& joint);
  /// Sets the rows of the next step. @param servos size model.dof_count(), or empty: none acts.
  void set(std::span<const model::Servo> servos);
  /// In the next solution rows whose torque is far below its limit have none, which the direct solver is
  /// faster with. @param tau of the step before [N m] or [N], size model.dof_count(); empty: all have their
  /// limits
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
  void soften(Row& row, const model::Servo& servo) const;
  static void set_limit(Row& row, double limit);

  double step_;
  std::vector<Row> rows_;
  bool at_rest_ = true;  ///< no row acts
};

}  // namespace handsim::engine::ode
