// Mechanical energy and momentum of a state.
#pragma once

#include <span>

#include "handsim/model/effects.h"
#include "handsim/model/state.h"

namespace handsim::model {

/// Kinetic energy of all bodies that can move freely [J].
double kinetic_energy(const Model& model, const State& state);

/// Potential energy of the effects that are on: gravity (0 at the origin) and stretched tissue [J].
double potential_energy(const Model& model, const State& state, const Effects& effects);

/// Mass and momentum of some bodies together, in world axes.
struct Momentum {
  double mass = 0;              ///< [kg]
  Vec3 centre = Vec3::Zero();   ///< of mass [m]
  Vec3 linear = Vec3::Zero();   ///< [kg m/s]
  Vec3 angular = Vec3::Zero();  ///< about the centre of mass [kg m^2/s]
};
Momentum momentum(const Model& model, const State& state, std::span<const int> bodies);

}  // namespace handsim::model
