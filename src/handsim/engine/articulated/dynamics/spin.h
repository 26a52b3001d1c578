// The spin of a free rigid body over one step, implicit, so that it never gains energy.
#pragma once

#include <optional>

#include "handsim/core/pose.h"

namespace handsim::engine::articulated {

/// Angular velocity at the end of a step without torque, in the principal axes at its start [rad/s]: the W
/// with
///   exp(h W) I W = I w,
/// that is, angular momentum is kept in a body that has turned by h W. The turn is about W itself, so that
/// W . (I w) = W . (I W); energy is convex in momentum, and E(w) >= E(W) + W . (I w - I W) = E(W).
/// @param moments I [kg m^2], @param spin w at the start [rad/s], both in principal axes; @param step h [s]
/// @returns nothing where Newton's method finds none: a turn of about a radian in a step.
std::optional<Vec3> spun(const Vec3& moments, const Vec3& spin, double step);

/// The derivative of W by w, a matrix in principal axes. @param end W
Mat3 spun_slope(const Vec3& moments, const Vec3& end, double step);

/// Left Jacobian of the rotation by a vector: how its exponential turns when the vector changes.
Mat3 left_jacobian(const Vec3& turn);

/// The gyroscopic torque [N m] that makes such a step from w [rad/s], in world axes. @returns nothing at
/// rest, or where `spun` returns nothing
std::optional<Vec3> gyroscopic_torque(const Vec3& moments, const Quat& q_WL, const Vec3& w, double step);

}  // namespace handsim::engine::articulated
