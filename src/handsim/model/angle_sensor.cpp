#include "handsim/model/angle_sensor.h"

#include <cmath>

#include "handsim/model/kinematics.h"

namespace handsim::model {

AngleSensor::AngleSensor(const Joint& joint)
    : universal_(joint.axes.size() == 2), parent_(as_index(joint.parent)), child_(as_index(joint.child)) {
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

double Direction::angle() const { return std::atan2(sin, cos); }

void AngleSensor::read_angles(const State& state, Direction* directions) const {
  const Quat r = state.bodies[parent_].q.conjugate() * state.bodies[child_].q;
  if (!universal_) {
    const double s = half_sin_.dot(r.coeffs());
    const double c = half_cos_.dot(r.coeffs());
    directions[0] = {2 * s * c, c * c - s * s};
    return;
  }
  // As in joint_coordinates: R b = cos q0 b + sin q0 c, and R^T a = cos q1 a + sin q1 c.
  const Vec3 b = r * b_C_;
  const Vec3 a = r.conjugate() * a_P_;
  directions[0] = {b.dot(c_P_), b.dot(b_P_)};
  directions[1] = {a.dot(c_C_), a.dot(a_C_)};
}

void AngleSensor::read(const State& state, double* q, double* u, Vec3* axes, Direction* directions) const {
  read_angles(state, directions);
  q[0] = directions[0].angle();
  const BodyState &parent = state.bodies[parent_], &child = state.bodies[child_];
  const Vec3 w = child.w - parent.w;
  axes[0] = parent.q * a_P_;
  u[0] = w.dot(axes[0]);
  if (!universal_) return;
  q[1] = directions[1].angle();
  axes[1] = child.q * b_C_;
  u[1] = w.dot(axes[1]);
}

JointSensors::JointSensors(const Model& model)
    : model_(model), axes_(as_index(model.dof_count()), Vec3::Zero()), directions_(axes_.size()) {
  for (const Joint& joint : model.joints) {
    std::optional<AngleSensor>& sensor = angles_.emplace_back();
    if (!joint.axes.empty() && !joint.slides(0)) sensor.emplace(joint);
  }
}

void JointSensors::read(State& state) {
  state.q.resize(axes_.size());
  state.u.resize(axes_.size());
  for (std::size_t j = 0; j < angles_.size(); ++j) {
    const Joint& joint = model_.joints[j];
    const auto first = as_index(joint.first_dof);
    if (angles_[j]) {
      angles_[j]->read(state, &state.q[first], &state.u[first], &axes_[first], &directions_[first]);
      continue;
    }
    joint_coordinates(joint, state, std::span(state.q).subspan(first));
    joint_rates(joint, state, std::span(state.u).subspan(first));
    for (std::size_t k = first; k < first + joint.axes.size(); ++k) {
      axes_[k] = axis_in_world(joint, k - first, state.bodies[as_index(joint.parent)].q,
                               state.bodies[as_index(joint.child)].q);
      if (!joint.slides(k - first)) directions_[k] = {std::sin(state.q[k]), std::cos(state.q[k])};
    }
  }
}

}  // namespace handsim::model
