// Commands to an engine other than torques: spring-damper drives that it solves implicitly in its step.
#pragma once

namespace handsim::model {

/// A spring-damper drive on one joint coordinate, evaluated at the end of a step of length h:
///   torque = stiffness (error - h qdot(t + h)) - damping qdot(t + h) + feed,  clamped to +-limit.
/// With error = target - q(t): stiffness (target - q(t + h)) - damping qdot(t + h) + feed, stable at any h.
/// Implicit steps of the articulated engine give it less damping, so that step and damper have max(damping,
/// h stiffness) together (engine/spring.h).
/// V: a number, or the numbers of several coordinates in lanes.
template <class V>
struct ServoOf {
  V stiffness = V(0.0);  ///< [N m/rad] or [N/m], >= 0
  V damping = V(0.0);    ///< [N m s/rad] or [N s/m], >= 0
  V error = V(0.0);      ///< target minus coordinate at the start of the step [rad] or [m]
  V feed = V(0.0);       ///< feed-forward torque, added to spring and damper [N m] or [N]
  V limit = V(0.0);      ///< largest torque [N m] or force [N], >= 0; 0: no drive

  /// Torque [N m] or [N] at a rate, after a motion since the error was found; without its limit.
  V pull(const V& moved, const V& rate) const { return stiffness * (error - moved) - damping * rate + feed; }
  /// Torque at the end of a step h, without its limit, at a rate u' there: start(h, u) - slope(h) (u' - u).
  V start(const V& h, const V& u) const { return stiffness * error + feed - slope(h) * u; }
  V slope(const V& h) const { return h * stiffness + damping; }
};

using Servo = ServoOf<double>;

}  // namespace handsim::model
