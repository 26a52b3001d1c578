#include "handsim/control/stability.h"

#include <algorithm>

#include "handsim/model/kinematics.h"

namespace handsim::control {

namespace {

/// Largest eigenvalue of M^-1 A for a diagonal A >= 0, as that of the symmetric A^1/2 M^-1 A^1/2, and the
/// eigenvector of the latter.
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
  out.axis = static_cast<std::size_t>(worst);
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

}  // namespace handsim::control
