// Commands to an engine other than torques: spring-damper drives that it solves implicitly in its step.
#pragma once

namespace handsim::model {

/// A spring-damper drive on one joint coordinate, evaluated at the end of a step of length h:
///   torque = stiffness (error - h qdot(t + h)) - damping qdot(t + h) + feed,  clamped to +-limit.
/// With error = target - q(t): stiffness (target - q(t + h)) - damping qdot(t + h) + feed, stable at any h.
struct Servo {
  double stiffness = 0;  ///< [N m/rad] or [N/m], >= 0
  double damping = 0;    ///< [N m s/rad] or [N s/m], >= 0
  double error = 0;      ///< target minus coordinate at the start of the step [rad] or [m]
  double feed = 0;       ///< feed-forward torque, added to spring and damper [N m] or [N]
  double limit = 0;      ///< largest torque [N m] or force [N], >= 0; 0: no drive
};

}  // namespace handsim::model
