// What a rollout's row says of its run.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "handsim/simulation/simulation.h"
#include "handsim/study/rollouts/rollout_table.h"

namespace handsim::study {

using NamedCells = std::vector<std::pair<std::string, Cell>>;

/// Figures and verdicts up to now: `joint_gap[m]`, `joint_gap.held`, and those of grasps and climbs.
NamedCells figures_of(const simulation::Simulation& simulation);

/// Every grasp is held; without a grasp, every criterion. Nothing where nothing is judged.
std::optional<bool> is_held(const simulation::Simulation& simulation, bool diverged);

/// Why a run has ended that did not diverge: `end`, or `decided` (an object has moved too far or is lost).
std::string ended(const simulation::Simulation& simulation);

}  // namespace handsim::study
