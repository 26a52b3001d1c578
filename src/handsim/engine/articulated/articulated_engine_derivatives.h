// Asks an articulated engine for the derivatives of its steps.
#pragma once

#include "handsim/engine/articulated/derivatives/step_derivatives.h"
#include "handsim/engine/engine.h"

namespace handsim::engine::articulated {

/// From now on steps of the engine fill in `out`, with contacts solved to rounding, until null is given. The
/// caller keeps `out` alive. Such a step throws Error (input), and is made by half, where there are no
/// derivatives: a method for smooth motion, loops, free hands, elastic tendons, contacts that Newton's method
/// does not solve.
/// @returns false for another engine than the articulated one
bool derive(const Engine& engine, StepDerivatives* out);

}  // namespace handsim::engine::articulated
