#include "handsim/control/inertia.h"

#include <algorithm>

#include "handsim/model/kinematics.h"

namespace handsim::control {

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
