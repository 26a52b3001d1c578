// Surfaces, muscles and bands in MJCF. Private to this folder.
#pragma once

#include <string>
#include <vector>

#include "handsim/engine/settings.h"
#include "handsim/model/model.h"
#include "handsim/model/state.h"

namespace handsim::output {

/// Attributes `condim` and `friction` of a geom, or of a pair, whose friction has five numbers.
std::string mjcf_friction(const model::Material& surface, const engine::Settings& settings, bool of_pair);

/// A `pair` for every two shapes that may touch and whose surfaces MuJoCo combines otherwise than handsim: it
/// takes the greater coefficient of friction, and its soft contacts are no springs in series.
std::string mjcf_pairs(const model::Model& model, const engine::Settings& settings);

/// MuJoCo's `body_invweight0` of bodies by index [1/kg]: how fast a force at the centre of mass accelerates
/// it, the mean over three directions, at zero coordinates. Zero for the world and kinematic bodies.
std::vector<double> mobilities(const model::Model& model);

/// Elements of <tendon> and <actuator>, each a line, indented by four; empty without muscles and bands.
struct MjcfTendons {
  std::string tendons, actuators;
  int count = 0;  ///< of actuators
};

/// MJCF's fixed tendons have constant moment arms: those at the state; an actuator has its muscle's isometric
/// force there, per activation, beside the passive one. MuJoCo's law of activation is muscle_curves.h's.
MjcfTendons mjcf_tendons(const model::Model& model, const engine::Settings& settings,
                         const model::State& state);

}  // namespace handsim::output
