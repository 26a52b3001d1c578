#include "handsim/core/pose.h"

#include <cmath>

namespace handsim {

Quat rotation_between(const Vec3& from, const Vec3& to) {
  const Vec3 a = from.normalized(), b = to.normalized();
  const Vec3 normal = a.cross(b);
  const double cosine = b.dot(a);
  // Near opposite directions 1 + cosine has lost its digits: half a turn, and what is left.
  if (cosine < -1 + 1e-4) {
    const Vec3 axis = normal.norm() > 1e-12 ? Vec3(normal.normalized()) : a.unitOrthogonal();
    return rotation_between(-a, b) * Eigen::AngleAxisd(M_PI, axis);
  }
  const double s = std::sqrt(2 * (1 + cosine));
  const Vec3 v = normal * (1 / s);
  return {0.5 * s, v.x(), v.y(), v.z()};
}

Vec3 rotation_vector(const Quat& q) {
  // q and -q are one rotation: the one with w >= 0 gives the angle up to pi.
  const double sign = q.w() < 0 ? -1.0 : 1.0;
  const Vec3 v = sign * q.vec();
  const double s = v.norm();
  // 2 atan2(s, w) / s tends to 2 / w as s goes to 0.
  if (s < 1e-12) return 2.0 * v;
  return 2.0 * std::atan2(s, sign * q.w()) / s * v;
}

Quat rotation_quaternion(const Vec3& r) {
  const double angle = r.norm();
  if (angle < 1e-12) return Quat(1, 0.5 * r.x(), 0.5 * r.y(), 0.5 * r.z()).normalized();
  const Vec3 v = std::sin(0.5 * angle) / angle * r;
  return {std::cos(0.5 * angle), v.x(), v.y(), v.z()};
}

}  // namespace handsim
