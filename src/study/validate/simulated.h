// Figures of the hand in simulations, for rows of measurements; private to this folder.
#pragma once

#include "handsim/study/validate/validate.h"

namespace handsim::study {

/// Runs the scene of a row into a folder. @throws Error (input) if its summary lacks the figure, or the scene
/// has problems
double simulated_figure(const Measurement& of, const std::filesystem::path& out);

}  // namespace handsim::study
