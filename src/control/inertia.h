// Joint-space inertia of a hand at a posture.
#pragma once

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

}  // namespace handsim::control
