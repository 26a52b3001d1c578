// Stability limit of explicit gains. With torques -K x - D v taken at the start of a step of length h and the
// new velocity moving the joint (symplectic Euler, which is what ODE does), the hinge I x'' = tau has
//   z^2 - (2 - a - b) z + 1 - a = 0,  a = D h / I, b = K h^2 / I,
// whose roots are inside the unit circle for 2 a + b < 4 (Jury). For coupled joints the same limit applies to
// the largest eigenvalue of M^-1 (2 h D + h^2 K), which is at least the value of each joint alone.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Dense>

namespace handsim::control {

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
