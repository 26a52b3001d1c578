// Mechanical energy of a state: what conservation checks compare.
#pragma once

#include "handsim/model/effects.h"
#include "handsim/model/state.h"

namespace handsim::model {

/// Kinetic energy of all bodies that can move freely [J].
double kinetic_energy(const Model& model, const State& state);

/// Energy stored in what the effects switch on: height above z = 0 (gravity) and stretched tissue [J].
double potential_energy(const Model& model, const State& state, const Effects& effects);

}  // namespace handsim::model
