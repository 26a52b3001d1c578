// What a hand's joints have to move: its joint-space inertia at a posture.
#pragma once

#include <Eigen/Dense>

#include "handsim/control/hand_axes.h"
#include "handsim/model/state.h"

namespace handsim::control {

/// Joint-space inertia M [kg m^2] of a hand's axes, in their order; symmetric, positive definite. A palm that
/// nothing holds moves freely and is eliminated (Schur complement); one that is held or driven does not move.
/// M = sum over bodies of m Jv^T Jv + Jw^T I Jw (Featherstone 2008, eq. 6.2 in Jacobian form).
Eigen::MatrixXd joint_inertia(const model::Model& model, const model::State& state,
                              const model::HandIndex& hand, const HandAxes& axes);

/// Effective inertia of each axis [kg m^2] for which gains are designed: sum over k of |M_jk|, what joint j
/// has to move when all joints of its finger accelerate alike. With K = w^2 R, D = 2 z w R, R the diagonal
/// matrix of these sums, no eigenvalue of R^-1 M exceeds 1 (Gershgorin), so every mode of the coupled finger
/// has a damping ratio of at least z and a frequency of at least w. A lone joint gets its own inertia.
Eigen::VectorXd effective_inertia(const Eigen::MatrixXd& inertia);

}  // namespace handsim::control
