// Plots of a controlled run by gnuplot: for each hand the targets and angles, errors, and torques, with a
// panel for each finger.
#pragma once

#include <filesystem>

#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

/// @throws Error (input) if gnuplot cannot be started; to be called before a run.
void need_gnuplot();

/// Writes plots/HAND_angles.png, HAND_errors.png, HAND_torques.png and their gnuplot scripts from the run's
/// control.sto, which must exist. @throws Error (output) if gnuplot fails.
void write_plots(const scene::Scene& scene, const std::filesystem::path& out);

}  // namespace handsim::simulation
