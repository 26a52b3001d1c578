// Derivatives of a step of a simulation: of the articulated engine, with the controller that drives it.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "handsim/engine/articulated/derivatives/step_derivatives.h"
#include "handsim/simulation/simulation.h"

namespace handsim::environment {

/// Rows and columns: engine/articulated/derivatives/step_derivatives.h.
struct Derivatives : engine::articulated::StepDerivatives {
  Eigen::MatrixXd by_target;  ///< of the controller's axes
};

/// The derivatives that a step is asked for.
struct DerivativesAsked {
  std::vector<std::string> bodies;  ///< names of those that forces act on
  bool excited = false;             ///< the caller gives excitations
  bool step_only = false;           ///< no derivatives: contacts are solved to rounding only
};

/// Makes a step. @param step makes one step of the simulation
/// @throws Error (input) for scenes and steps that have no derivatives; the caller then restores the
/// simulation
Derivatives step_with_derivatives(const simulation::Simulation& simulation, const std::function<void()>& step,
                                  const DerivativesAsked& asked);

}  // namespace handsim::environment
