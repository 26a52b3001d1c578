// Rigid poses, and the mirror image that makes a left hand from a right one. Notation: `X_AB` is the pose of
// frame B in frame A, with `p_AB` its origin and `q_AB` its rotation (v_A = q_AB * v_B).
#pragma once

#include <Eigen/Geometry>

namespace handsim {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Quat = Eigen::Quaterniond;

/// Pose of one frame in another.
struct Pose {
  Vec3 p = Vec3::Zero();      ///< origin [m]
  Quat q = Quat::Identity();  ///< rotation, unit

  /// X_AC = X_AB * X_BC.
  Pose operator*(const Pose& other) const { return {p + q * other.p, (q * other.q).normalized()}; }
  /// Point given in the inner frame, returned in the outer [m].
  Vec3 operator*(const Vec3& point) const { return p + q * point; }
  Pose inverse() const { return {-(q.conjugate() * p), q.conjugate()}; }
};

/// Mirror of a position or another true vector in the y-z plane.
inline Vec3 mirrored(const Vec3& v) { return {-v.x(), v.y(), v.z()}; }
/// Mirror of a rotation axis, angular velocity or torque (pseudo-vector) in the y-z plane.
inline Vec3 mirrored_axis(const Vec3& a) { return {a.x(), -a.y(), -a.z()}; }
/// Mirror of a rotation in the y-z plane: the axis is mirrored as a pseudo-vector.
inline Quat mirrored(const Quat& q) { return {q.w(), q.x(), -q.y(), -q.z()}; }
inline Pose mirrored(const Pose& x) { return {mirrored(x.p), mirrored(x.q)}; }

/// The shortest rotation that turns direction `from` into direction `to`, which need no unit length. Where
/// they are opposite, the axis is any one that is perpendicular to them.
Quat rotation_between(const Vec3& from, const Vec3& to);
/// Rotation vector (axis times angle in 0..pi) [rad] of a unit quaternion.
Vec3 rotation_vector(const Quat& q);
/// [v]: its product with w is v x w.
inline Mat3 cross_matrix(const Vec3& v) {
  return Mat3{{0, -v.z(), v.y()}, {v.z(), 0, -v.x()}, {-v.y(), v.x(), 0}};
}
/// Unit quaternion of a rotation vector [rad].
Quat rotation_quaternion(const Vec3& rotation_vector);

}  // namespace handsim
