// Plots of a controlled run by gnuplot: for each hand targets against angles, errors, and torques, a panel a
// finger.
#pragma once

#include <filesystem>

#include "handsim/control/plan.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

/// @throws Error (input) where no gnuplot can be started: to be called before a run.
void need_gnuplot();

/// Writes plots/HAND_angles.png, HAND_errors.png, HAND_torques.png and the gnuplot scripts that made them,
/// from the run's control.sto (which must be there). @throws Error (output) where gnuplot fails.
void write_plots(const scene::Scene& scene, const std::filesystem::path& out);

}  // namespace handsim::simulation
