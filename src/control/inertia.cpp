#include "handsim/control/inertia.h"

#include "handsim/core/index.h"

namespace handsim::control {

namespace {

using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// For each body the joint to its parent; null if it has none.
std::vector<const model::Joint*> parent_joints(const model::Model& model) {
  std::vector<const model::Joint*> out(model.bodies.size());
  for (const model::Joint& joint : model.joints)
    if (!joint.closes_loop) out[at(joint.child)] = &joint;
  return out;
}

/// Sets one column of a body's Jacobian in world axes: linear velocity of its centre of mass at p, then
/// angular velocity.
void add_axis(Jacobian& jacobian, Eigen::Index column, const model::Joint& joint, std::size_t axis,
              const model::State& state, const Vec3& p) {
  const model::BodyState &parent = state.bodies[at(joint.parent)], &child = state.bodies[at(joint.child)];
  const Vec3& local = joint.axes[axis].axis;
  const Vec3 a = axis == 0 ? Vec3(parent.q * (joint.parent_frame.q * local))
                           : Vec3(child.q * (joint.child_frame.q * local));
  const Vec3 anchor = child.p + child.q * joint.child_frame.p;
  jacobian.block<3, 1>(0, column) = a.cross(p - anchor);
  jacobian.block<3, 1>(3, column) = a;
}

}  // namespace

Eigen::MatrixXd joint_inertia(const model::Model& model, const model::State& state,
                              const model::HandIndex& hand, const HandAxes& axes) {
  const std::vector<const model::Joint*> parent_joint = parent_joints(model);
  const std::size_t palm = at(hand.palm);
  const bool floating = !model.bodies[palm].kinematic && !parent_joint[palm];
  const auto n = static_cast<Eigen::Index>(axes.axes.size());
  const Eigen::Index size = n + (floating ? 6 : 0);
  Eigen::MatrixXd inertia = Eigen::MatrixXd::Zero(size, size);
  for (const int index : hand.bodies) {
    const std::size_t b = at(index);
    if (model.bodies[b].kinematic) continue;
    const model::BodyState& body = state.bodies[b];
    Jacobian jacobian = Jacobian::Zero(6, size);
    for (const model::Joint* joint = parent_joint[b]; joint; joint = parent_joint[at(joint->parent)])
      for (Eigen::Index k = 0; k < n; ++k) {
        const HandAxis& axis = axes.axes[at(k)];
        if (&model.joints[axis.joint_index] == joint)
          add_axis(jacobian, k, *joint, axis.axis_index, state, body.p);
      }
    if (floating) {
      jacobian.rightCols(6).setIdentity();
      const Vec3 r = body.p - state.bodies[palm].p;
      for (int i = 0; i < 3; ++i) jacobian.block<3, 1>(0, n + 3 + i) = Vec3::Unit(i).cross(r);
    }
    const Mat3 rotation = body.q.toRotationMatrix();
    Eigen::Matrix<double, 6, 6> spatial = Eigen::Matrix<double, 6, 6>::Zero();
    spatial.topLeftCorner<3, 3>() = model.bodies[b].mass * Mat3::Identity();
    spatial.bottomRightCorner<3, 3>() = rotation * model.bodies[b].inertia * rotation.transpose();
    inertia += jacobian.transpose() * spatial * jacobian;
  }
  if (!floating) return inertia;
  const Eigen::MatrixXd coupling = inertia.topRightCorner(n, 6);
  return inertia.topLeftCorner(n, n) -
         coupling * inertia.bottomRightCorner<6, 6>().ldlt().solve(coupling.transpose());
}

Eigen::VectorXd effective_inertia(const Eigen::MatrixXd& inertia) {
  return inertia.cwiseAbs().rowwise().sum();
}

}  // namespace handsim::control
