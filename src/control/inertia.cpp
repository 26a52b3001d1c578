#include "handsim/control/inertia.h"

namespace handsim::control {

namespace {

using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// Index of the joint whose child a body is, -1 for none.
std::vector<int> carrying_joints(const model::Model& model) {
  std::vector<int> out(model.bodies.size(), -1);
  for (std::size_t j = 0; j < model.joints.size(); ++j)
    if (!model.joints[j].closes_loop)
      out[static_cast<std::size_t>(model.joints[j].child)] = static_cast<int>(j);
  return out;
}

/// Axes in the world, one column of J each: linear velocity of the body's centre of mass over its angular
/// velocity.
void add_axis(Jacobian& jacobian, Eigen::Index column, const model::Joint& joint, std::size_t axis,
              const model::State& state, const Vec3& p) {
  const model::BodyState& parent = state.bodies[static_cast<std::size_t>(joint.parent)];
  const model::BodyState& child = state.bodies[static_cast<std::size_t>(joint.child)];
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
  const std::vector<int> carrying = carrying_joints(model);
  const auto palm = static_cast<std::size_t>(hand.palm);
  const bool floating = !model.bodies[palm].kinematic && carrying[palm] < 0;
  const auto n = static_cast<Eigen::Index>(axes.axes.size());
  const Eigen::Index size = n + (floating ? 6 : 0);
  Eigen::MatrixXd inertia = Eigen::MatrixXd::Zero(size, size);
  for (const int index : hand.bodies) {
    const auto b = static_cast<std::size_t>(index);
    if (model.bodies[b].kinematic) continue;
    const model::BodyState& body = state.bodies[b];
    Jacobian jacobian = Jacobian::Zero(6, size);
    for (int j = carrying[b]; j >= 0;) {
      const model::Joint& joint = model.joints[static_cast<std::size_t>(j)];
      for (Eigen::Index k = 0; k < n; ++k) {
        const HandAxis& axis = axes.axes[static_cast<std::size_t>(k)];
        if (axis.joint_index == static_cast<std::size_t>(j))
          add_axis(jacobian, k, joint, axis.axis_index, state, body.p);
      }
      j = carrying[static_cast<std::size_t>(joint.parent)];
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
