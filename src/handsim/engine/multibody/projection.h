// Projections onto the joint constraints in the metric of the mass matrix: positions, velocities,
// accelerations that keep joints closed. Least squares: constraints may be redundant if they are consistent.
#pragma once

#include "handsim/engine/multibody/system.h"

namespace handsim::engine {

inline constexpr double kMaxClosedError = 1e-13;  ///< Largest constraint error of a closed joint [m, or 1].

/// Moves the island's bodies until constraint errors are below kMaxClosedError times the largest coordinate
/// (at least 1). @throws Error (physics) naming the joint that stays open
void project_positions(const System& system, model::State& state);

/// Changes the velocities by joint impulses so that the constraint errors have zero rates.
void project_velocities(const System& system, model::State& state);

/// Closes the joints at the end of a step of length `step` [s] from `before` to `after`. Joint impulses with
/// the directions of `before` change the velocities, and the positions by the displacement that this gives in
/// the step: SHAKE (Ryckaert, Ciccotti & Berendsen 1977, J Comput Phys 23:327).
/// @throws Error (physics) naming the joint that stays open.
void close_step(const System& system, const model::State& before, double step, model::State& after);

/// Rejects a singular start, such as a fully stretched four-bar linkage: the initial velocities (or, at rest,
/// those that gravity and tissue would cause) satisfy the constraints, but no accelerations do, so that a
/// simulation would create energy. @throws Error (input) with a joint of each such loop
void require_regular_start(const model::Model& model, const Settings& settings, const model::State& start);

/// Accelerations under the applied forces and the joint constraints.
struct Accelerations {
  Vector acceleration;  ///< u', 6 per body
  Vector multipliers;   ///< of the rows in `rows` [N or N m]
};

/// Accelerations at a state that satisfies the constraints. @param rows indices of independent rows
Accelerations accelerations(const System& system, const model::State& state, std::span<const double> torques,
                            const std::vector<Index>& rows);

/// A maximal set of independent constraint rows, chosen by QR with column pivoting.
/// @param weakest set to the last diagonal element of R for rows of unit length: 1 for orthogonal rows
std::vector<Index> independent_rows(const System& system, const model::State& state, double& weakest);
/// The value `weakest` for given rows at another state.
double independence(const System& system, const model::State& state, const std::vector<Index>& rows);

}  // namespace handsim::engine
