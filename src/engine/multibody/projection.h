// Back onto the constraints: the nearest positions (in the metric of the masses) at which every joint is
// closed, the nearest velocities that keep it so, and the accelerations that go with them. Least squares,
// so redundant constraints are welcome as long as they agree.
#pragma once

#include "handsim/engine/multibody/system.h"

namespace handsim::engine {

/// Largest constraint error [m, or 1] that counts as whole.
inline constexpr double kWhole = 1e-13;

/// Moves the island's bodies until every constraint error is below kWhole of the largest coordinate or 1.
/// @throws Error (physics) naming the joint that stays open.
void project_positions(const System& system, model::State& state);

/// Changes the velocities as an impulse would until no constraint error grows.
void project_velocities(const System& system, model::State& state);

/// Closes the joints at the end of a step from `before` to `after` [s long] by impulses of the joints as they
/// stood in `before`: positions move by what the impulses do within the step, velocities change with them.
/// That is SHAKE (Ryckaert, Ciccotti & Berendsen 1977, J Comput Phys 23:327) in the metric of the masses.
/// @throws Error (physics) naming the joint that stays open.
void close_step(const System& system, const model::State& before, double step, model::State& after);

/// Refuses a start in which joints let the bodies start to move, as their velocities or else gravity and
/// tissue have it, and no further, as those of a four-bar pulled straight do: at velocity level all is well
/// there, at the level of accelerations the joints contradict each other, and energy comes from nowhere.
/// @throws Error (input) naming a joint of each such loop
void require_regular_start(const model::Model& model, const Settings& settings, const model::State& start);

/// What the joints make of the forces.
struct Accelerations {
  Vector acceleration;  ///< u', 6 per body
  Vector multipliers;   ///< of the rows in `rows` [N or N m]
};

/// Accelerations at a state that satisfies the constraints. @param rows which constraint rows hold the
/// joints, independent of each other.
Accelerations accelerations(const System& system, const model::State& state, std::span<const double> torques,
                            const std::vector<Index>& rows);

/// Constraint rows that are independent of each other and that all others follow from, best first.
/// @param weakest set to how independent the last one is, relative to the first (1: entirely)
std::vector<Index> independent_rows(const System& system, const model::State& state, double& weakest);
/// How independent given rows are at another state, on the same scale.
double independence(const System& system, const model::State& state, const std::vector<Index>& rows);

}  // namespace handsim::engine
