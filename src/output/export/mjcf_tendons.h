// Muscles and bands of a model as MJCF; private to this folder.
#pragma once

#include <string>

#include "handsim/engine/settings.h"
#include "handsim/model/state.h"

namespace handsim::output {

/// Elements of <tendon> and <actuator>, each a line, indented by four; empty without muscles and bands in
/// effect.
struct MjcfTendons {
  std::string tendons, actuators;
  int count = 0;  ///< of actuators
};

/// MJCF's fixed tendons have constant moment arms: a tendon gets the arms that it has at the state, an
/// actuator the isometric force of its muscle there, per activation, beside the passive one. Excitation
/// drives activation by MuJoCo's muscle law, which is that of muscle_curves.h.
MjcfTendons mjcf_tendons(const model::Model& model, const engine::Settings& settings,
                         const model::State& state);

}  // namespace handsim::output
