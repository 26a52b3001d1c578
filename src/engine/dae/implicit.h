// The part of the forces that the fixed-step formulations treat implicitly, linearised.
#pragma once

#include "handsim/engine/multibody/system.h"

namespace handsim::engine::dae {

/// M - a df/du - a b df/dx T for gyroscopic torques and tissue, where new velocities count a times in a
/// step's momentum and b times in its displacement [s].
Matrix implicit_mass(const System& system, const model::State& state, double a, double b);

}  // namespace handsim::engine::dae
