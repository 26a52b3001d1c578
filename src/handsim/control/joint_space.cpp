#include "handsim/control/joint_space.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "handsim/model/kinematics.h"

namespace handsim::control {

namespace {

/// Largest eigenvalue of M^-1 A, diagonal A >= 0, as that of A^1/2 M^-1 A^1/2, and the latter's eigenvector.
std::pair<double, Eigen::VectorXd> largest(const Eigen::MatrixXd& inverse, const Eigen::VectorXd& a) {
  const Eigen::VectorXd root = a.cwiseSqrt();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(root.asDiagonal() * inverse *
                                                              root.asDiagonal());
  const Eigen::Index last = a.size() - 1;
  return {solver.eigenvalues()[last], solver.eigenvectors().col(last)};
}

}  // namespace

Stability explicit_stability(const Eigen::MatrixXd& inertia, const Eigen::VectorXd& proportional,
                             const Eigen::VectorXd& derivative, double step) {
  const Eigen::MatrixXd inverse =
      inertia.llt().solve(Eigen::MatrixXd::Identity(inertia.rows(), inertia.cols()));
  const auto eigenvalue = [&](double h) {
    return largest(inverse, 2 * h * derivative + h * h * proportional);
  };
  const auto [value, vector] = eigenvalue(step);
  Stability out;
  out.eigenvalue = value;
  Eigen::Index worst = 0;
  vector.cwiseAbs().maxCoeff(&worst);
  out.axis = as_index(worst);
  out.inertia = 1 / inverse(worst, worst);
  out.damping_number = derivative[worst] * step / out.inertia;
  out.stiffness_number = proportional[worst] * step * step / out.inertia;
  // The eigenvalue grows with the step: bisection for the step at the limit.
  double low = 0, high = step;
  while (eigenvalue(high).first < kExplicitLimit && high < 1) high *= 2;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (eigenvalue(middle).first < kExplicitLimit ? low : high) = middle;
  }
  out.largest_step = low;
  return out;
}

Eigen::MatrixXd joint_inertia(const model::Model& model, const model::State& state,
                              const model::HandIndex& hand, const HandAxes& axes) {
  std::vector<int> free = model::free_bodies(model);
  std::erase_if(free, [&](int body) { return body != hand.palm; });
  const Eigen::MatrixXd all = model::mass_matrix(model, state, hand.bodies, free);
  std::vector<std::size_t> own;
  for (const HandAxis& axis : axes.axes) own.push_back(axis.dof);
  const Eigen::MatrixXd inertia = all(own, own);
  if (free.empty()) return inertia;
  const Eigen::MatrixXd coupling = all(own, Eigen::lastN(6));
  return inertia - coupling * all.bottomRightCorner<6, 6>().ldlt().solve(coupling.transpose());
}

Eigen::VectorXd effective_inertia(const Eigen::MatrixXd& inertia) {
  return inertia.cwiseAbs().rowwise().sum();
}

GravityLoad::GravityLoad(const model::Model& model, const Vec3& gravity)
    : model_(model),
      gravity_(gravity),
      moments_(model.bodies.size(), Vec3::Zero()),
      torques_(as_index(model.dof_count()), 0.0) {
  std::vector<double> distal_mass;
  std::vector<bool> is_child(model.bodies.size(), false);
  for (const model::Body& body : model.bodies) distal_mass.push_back(body.mass);
  for (const model::Joint& joint : model.joints)
    if (!joint.closes_loop) is_child[as_index(joint.child)] = true;
  // Parents come before children: the reverse order sums from the fingertips.
  for (std::size_t j = model.joints.size(); j-- > 0;) {
    const model::Joint& joint = model.joints[j];
    if (joint.closes_loop) continue;
    Link link{&joint,
              as_index(joint.parent),
              as_index(joint.child),
              as_index(joint.first_dof),
              distal_mass[as_index(joint.child)],
              is_child[as_index(joint.parent)]};
    distal_mass[link.parent] += link.mass;
    links_.push_back(link);
  }
}

std::span<const double> GravityLoad::torques(const model::State& state) {
  for (const Link& link : links_) {
    const model::BodyState& child = state.bodies[link.child];
    moments_[link.child] = model_.bodies[link.child].mass * child.p;
  }
  for (const Link& link : links_) {
    const model::BodyState& child = state.bodies[link.child];
    const Vec3 moment = moments_[link.child];
    if (link.adds_to_parent) moments_[link.parent] += moment;
    const Vec3 anchor = child.p + child.q * link.joint->child_frame.p;
    const Vec3 torque = (moment - link.mass * anchor).cross(gravity_);
    for (std::size_t k = 0; k < link.joint->axes.size(); ++k)
      if (!link.joint->slides(k))
        torques_[link.dof + k] =
            -torque.dot(axis_in_world(*link.joint, k, state.bodies[link.parent].q, child.q));
  }
  return torques_;
}

}  // namespace handsim::control
