#include "handsim/model/angle_sensor.h"

#include <cmath>

#include "handsim/model/kinematics.h"

namespace handsim::model {

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

std::array<double, 2> AngleSensor::angles(const State& state) const {
  const Quat r = state.bodies[parent_].q.conjugate() * state.bodies[child_].q;
  if (!universal_) {
    const double s = half_sin_.dot(r.coeffs());
    const double c = half_cos_.dot(r.coeffs());
    return {std::atan2(2 * s * c, c * c - s * s), 0};
  }
  // As in joint_coordinates: R b = cos q0 b + sin q0 c, and R^T a = cos q1 a + sin q1 c.
  const Vec3 b = r * b_C_;
  const Vec3 a = r.conjugate() * a_P_;
  return {std::atan2(b.dot(c_P_), b.dot(b_P_)), std::atan2(a.dot(c_C_), a.dot(a_C_))};
}

std::array<Vec3, 2> AngleSensor::axes(const State& state) const {
  return {state.bodies[parent_].q * a_P_,
          universal_ ? Vec3(state.bodies[child_].q * b_C_) : Vec3(Vec3::Zero())};
}

std::array<double, 2> AngleSensor::rates(const State& state) const {
  const Vec3 w = state.bodies[child_].w - state.bodies[parent_].w;
  const std::array<Vec3, 2> axis = axes(state);
  return {w.dot(axis[0]), universal_ ? w.dot(axis[1]) : 0.0};
}

JointSensors::JointSensors(const Model& model) : model_(model) {
  for (const Joint& joint : model.joints) {
    std::optional<AngleSensor>& sensor = angles_.emplace_back();
    if (joint.kind == JointKind::hinge || joint.kind == JointKind::universal) sensor.emplace(joint);
  }
}

void JointSensors::read(State& state) const {
  state.q.resize(static_cast<std::size_t>(model_.dof_count()));
  state.u.resize(state.q.size());
  for (std::size_t j = 0; j < angles_.size(); ++j) {
    const Joint& joint = model_.joints[j];
    const auto first = static_cast<std::size_t>(joint.first_dof);
    if (!angles_[j]) {
      joint_coordinates(joint, state, std::span(state.q).subspan(first));
      joint_rates(joint, state, std::span(state.u).subspan(first));
      continue;
    }
    const std::array<double, 2> angle = angles_[j]->angles(state), rate = angles_[j]->rates(state);
    for (std::size_t k = 0; k < joint.axes.size(); ++k) {
      state.q[first + k] = angle[k];
      state.u[first + k] = rate[k];
    }
  }
}

std::array<Vec3, 2> JointSensors::axes(std::size_t j, const State& state) const {
  if (angles_[j]) return angles_[j]->axes(state);
  const Joint& joint = model_.joints[j];
  if (joint.axes.empty()) return {Vec3::Zero(), Vec3::Zero()};
  const Quat& q_WP = state.bodies[static_cast<std::size_t>(joint.parent)].q;
  return {q_WP * (joint.parent_frame.q * joint.axes[0].axis), Vec3::Zero()};
}

}  // namespace handsim::model
