// Joint torques from recorded motion, to check the torques that engines report.
#pragma once

#include "handsim/model/state.h"

namespace handsim::model {

/// Torques along all coordinates that move the bodies from one state to a later one (Newton-Euler): for each
/// joint, the rate of change of the momentum of all bodies distal to it, less gravity [m/s^2], about the
/// child's anchor and along the joint's axes in the first state. Means over the time between the states,
/// accurate to first order in it; zero for balls. Includes the torques of active stops and contacts. For
/// models without loops.
std::vector<double> inverse_dynamics(const Model& model, const State& from, const State& to,
                                     const Vec3& gravity);

}  // namespace handsim::model
