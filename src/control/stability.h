// Joint-space inertia of a hand, and the stability limit of explicit gains. With torques -K x - D v taken at
// the start of a step of length h and the new velocity moving the joint (symplectic Euler, which is what ODE
// does), the hinge I x'' = tau has
//   z^2 - (2 - a - b) z + 1 - a = 0,  a = D h / I, b = K h^2 / I,
// whose roots are inside the unit circle for 2 a + b < 4 (Jury). For coupled joints the same limit applies to
// the largest eigenvalue of M^-1 (2 h D + h^2 K), which is at least the value of each joint alone.
#pragma once

#include <vector>

#include <Eigen/Dense>

#include "handsim/control/hand_axes.h"
#include "handsim/model/state.h"

namespace handsim::control {

/// Joint-space inertia M [kg m^2] of a hand's axes, in their order; symmetric, positive definite. A free palm
/// is eliminated (Schur complement); a fixed or driven one does not move.
Eigen::MatrixXd joint_inertia(const model::Model& model, const model::State& state,
                              const model::HandIndex& hand, const HandAxes& axes);

/// Effective inertia of each axis [kg m^2] for the design of gains: sum over k of |M_jk|, a bound on the
/// inertia at joint j when all joints of its finger have the same acceleration. With K = w^2 R, D = 2 z w R,
/// R the diagonal matrix of these sums, no eigenvalue of R^-1 M exceeds 1 (Gershgorin), so every mode of the
/// coupled finger has a damping ratio of at least z and a frequency of at least w.
Eigen::VectorXd effective_inertia(const Eigen::MatrixXd& inertia);

inline constexpr double kExplicitLimit = 4;

/// Explicit gains compared with their limit.
struct Stability {
  double eigenvalue = 0;        ///< largest eigenvalue of M^-1 (2 h D + h^2 K); stable below kExplicitLimit
  std::size_t axis = 0;         ///< with the largest component in its eigenvector
  double inertia = 0;           ///< of that axis with all others free, 1 / (M^-1)_jj [kg m^2]
  double damping_number = 0;    ///< D h / I of that axis
  double stiffness_number = 0;  ///< K h^2 / I of that axis
  double largest_step = 0;      ///< with which these gains reach the limit [s]
};

/// @param inertia joint-space inertia of the axes [kg m^2]; @param proportional K [N m/rad] and @param
/// derivative D [N m s/rad] of each; @param step h [s].
Stability explicit_stability(const Eigen::MatrixXd& inertia, const Eigen::VectorXd& proportional,
                             const Eigen::VectorXd& derivative, double step);

}  // namespace handsim::control
