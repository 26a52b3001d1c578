// Mechanical energy of a state, for checks of conservation.
#pragma once

#include "handsim/model/effects.h"
#include "handsim/model/state.h"

namespace handsim::model {

/// Kinetic energy of all bodies that can move freely [J].
double kinetic_energy(const Model& model, const State& state);

/// Potential energy of the effects that are on: gravity (0 at the origin) and stretched tissue [J].
double potential_energy(const Model& model, const State& state, const Effects& effects);

}  // namespace handsim::model
