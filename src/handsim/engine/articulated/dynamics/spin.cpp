#include "handsim/engine/articulated/dynamics/spin.h"

#include <cmath>

#include <Eigen/LU>

namespace handsim::engine::articulated {

namespace {

constexpr int kIterations = 12;
constexpr double kTolerance = 1e-14;

/// The derivative of exp(h W) I W.
Mat3 turned_slope(const Vec3& moments, const Vec3& end, double step) {
  const Vec3 turn = step * end;
  const Mat3 R = rotation_quaternion(turn).toRotationMatrix();
  return R * Mat3(moments.asDiagonal()) -
         step * cross_matrix(R * Vec3(moments.cwiseProduct(end))) * left_jacobian(turn);
}

}  // namespace

Mat3 left_jacobian(const Vec3& turn) {
  const double angle = turn.norm();
  const Mat3 K = cross_matrix(turn);
  if (angle < 1e-4) return Mat3::Identity() + 0.5 * K + K * K / 6;
  const double square = angle * angle;
  return Mat3::Identity() + (1 - std::cos(angle)) / square * K +
         (angle - std::sin(angle)) / (square * angle) * K * K;
}

Mat3 spun_slope(const Vec3& moments, const Vec3& end, double step) {
  return turned_slope(moments, end, step).inverse() * Mat3(moments.asDiagonal());
}

std::optional<Vec3> spun(const Vec3& moments, const Vec3& spin, double step) {
  const Vec3 momentum = moments.cwiseProduct(spin);
  const double scale = momentum.norm();
  Vec3 out = spin;
  for (int i = 0; i < kIterations; ++i) {
    const Vec3 turn = step * out;
    const Vec3 turned = rotation_quaternion(turn) * Vec3(moments.cwiseProduct(out));
    const Vec3 error = turned - momentum;
    if (error.norm() <= kTolerance * scale) return out;
    const Mat3 R = rotation_quaternion(turn).toRotationMatrix();
    const Mat3 slope = R * Mat3(moments.asDiagonal()) - step * cross_matrix(turned) * left_jacobian(turn);
    out -= slope.partialPivLu().solve(error);
    if (!out.allFinite()) return std::nullopt;
  }
  return std::nullopt;
}

std::optional<Vec3> gyroscopic_torque(const Vec3& moments, const Quat& q_WL, const Vec3& w, double step) {
  const Vec3 spin = q_WL.conjugate() * w;
  if (spin.isZero(0)) return std::nullopt;
  const std::optional<Vec3> end = spun(moments, spin, step);
  if (!end) return std::nullopt;
  return q_WL * Vec3(moments.cwiseProduct(spin - *end) / step);
}

}  // namespace handsim::engine::articulated
