// Joint-space inertia of a hand, torques that balance its weight, and the stability limit of explicit gains.
// With torques -K x - D v taken at the start of a step of length h and the new velocity moving the joint
// (symplectic Euler, which is what ODE does), the hinge I x'' = tau has
//   z^2 - (2 - a - b) z + 1 - a = 0,  a = D h / I, b = K h^2 / I,
// whose roots are inside the unit circle for 2 a + b < 4 (Jury). For coupled joints the same limit applies to
// the largest eigenvalue of M^-1 (2 h D + h^2 K), which is at least the value of each joint alone.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

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

/// @param inertia of the axes [kg m^2]; proportional K [N m/rad] and derivative D [N m s/rad]; step h [s].
Stability explicit_stability(const Eigen::MatrixXd& inertia, const Eigen::VectorXd& proportional,
                             const Eigen::VectorXd& derivative, double step);

class GravityLoad {
 public:
  /// For all hinges and universal joints of the model, which must outlive this object. @param gravity
  /// [m/s^2].
  GravityLoad(const model::Model& model, const Vec3& gravity);

  /// Torque of each coordinate that balances the weight distal to its joint [N m], size model.dof_count():
  ///   tau_j = -a_j . ((S_j - m_j p_j) x g)
  /// with the axis a_j, anchor p_j, mass m_j and first moment S_j of all bodies beyond; until the next call.
  std::span<const double> torques(const model::State& state);

 private:
  /// A joint of a chain, children before parents.
  struct Link {
    const model::Joint* joint = nullptr;
    std::size_t parent = 0, child = 0, dof = 0;
    double mass = 0;              ///< of all bodies distal to it [kg]
    bool adds_to_parent = false;  ///< its parent is the child of another joint
  };

  const model::Model& model_;
  Vec3 gravity_;
  std::vector<Link> links_;
  std::vector<Vec3> moments_;  ///< by body
  std::vector<double> torques_;
};

}  // namespace handsim::control
