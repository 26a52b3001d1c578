// Joint torques that go with a motion: the check of what engines report and of how they move.
#pragma once

#include "handsim/model/state.h"

namespace handsim::model {

/// Torques along all coordinates that take the bodies from one state to a later one, by Newton and Euler: for
/// each joint what the momentum of its bodies beyond changes by and gravity [m/s^2] does not give, about the
/// child's anchor and along its axes where the motion begins. Means over the time between the states, right
/// to first order in it; balls have zeros. Stops and contacts that act count as torque. For models without
/// loops.
std::vector<double> inverse_dynamics(const Model& model, const State& from, const State& to,
                                     const Vec3& gravity);

}  // namespace handsim::model
