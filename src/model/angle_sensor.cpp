#include "handsim/model/angle_sensor.h"

#include <cmath>

namespace handsim::model {

double Direction::angle() const { return std::atan2(sin, cos); }

AngleSensor::AngleSensor(const Joint& joint)
    : universal_(joint.kind == JointKind::universal),
      parent_(static_cast<std::size_t>(joint.parent)),
      child_(static_cast<std::size_t>(joint.child)) {
  const Quat& f = joint.parent_frame.q;
  const Quat& m = joint.child_frame.q;
  const Vec3 a = joint.axes[0].axis;
  if (universal_) {
    const Vec3 b = joint.axes[1].axis;
    const Vec3 c = a.cross(b);
    a_P_ = f * a, b_P_ = f * b, c_P_ = f * c;
    a_C_ = m * a, b_C_ = m * b, c_C_ = m * c;
    return;
  }
  a_P_ = f * a;
  // The coefficients of a linear map are its values on the unit vectors.
  for (int i = 0; i < 4; ++i) {
    const Quat q_FM = f.conjugate() * Quat(Eigen::Vector4d::Unit(i)) * m;
    half_sin_[i] = q_FM.vec().dot(a);
    half_cos_[i] = q_FM.w();
  }
}

std::array<Direction, 2> AngleSensor::read(const State& state) const {
  const Quat r = state.bodies[parent_].q.conjugate() * state.bodies[child_].q;
  if (!universal_) {
    const double s = half_sin_.dot(r.coeffs());
    const double c = half_cos_.dot(r.coeffs());
    return {Direction{2 * s * c, c * c - s * s}, Direction{}};
  }
  // As in joint_coordinates: R b = cos q0 b + sin q0 c, and R^T a = cos q1 a + sin q1 c.
  const Vec3 b = r * b_C_;
  const Vec3 a = r.conjugate() * a_P_;
  return {Direction{b.dot(c_P_), b.dot(b_P_)}, Direction{a.dot(c_C_), a.dot(a_C_)}};
}

std::array<double, 2> AngleSensor::rates(const State& state) const {
  const BodyState& parent = state.bodies[parent_];
  const BodyState& child = state.bodies[child_];
  const Vec3 w = child.w - parent.w;
  return {w.dot(parent.q * a_P_), universal_ ? w.dot(child.q * b_C_) : 0.0};
}

}  // namespace handsim::model
