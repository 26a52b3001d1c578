// euler_linearised and euler_projected.
#pragma once

#include "handsim/engine/dae/integrator.h"

namespace handsim::engine::dae {

/// The method of the settings: euler_linearised or euler_projected.
std::unique_ptr<Integrator> make_euler(System system, const Settings& settings);

/// The matrix of the implicit methods with fixed step: M - a df/du - a b df/dx T, with the derivatives of
/// gyroscopic torques and tissue; a and b [s] weigh the new velocities in the step's impulse and motion.
Matrix implicit_mass(const System& system, const model::State& state, double a, double b);

}  // namespace handsim::engine::dae
