// Rotation by a unit quaternion in the caller's code: Eigen's stays a call of its own, and its operands go
// through memory.
#pragma once

#include "handsim/core/pose.h"

namespace handsim::engine {

/// q * v, to the bit.
[[gnu::always_inline]] inline Vec3 rotate(const Quat& q, const Vec3& v) {
  const double w = q.w(), x = q.x(), y = q.y(), z = q.z();
  const double a = 2 * (y * v.z() - z * v.y()), b = 2 * (z * v.x() - x * v.z()),
               c = 2 * (x * v.y() - y * v.x());
  return {v.x() + w * a + (y * c - z * b), v.y() + w * b + (z * a - x * c), v.z() + w * c + (x * b - y * a)};
}
/// q.conjugate() * v, to the bit.
[[gnu::always_inline]] inline Vec3 rotate_back(const Quat& q, const Vec3& v) {
  return rotate(q.conjugate(), v);
}

}  // namespace handsim::engine
