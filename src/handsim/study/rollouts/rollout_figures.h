// What a rollout's row says of its run.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "handsim/simulation/simulation.h"
#include "handsim/study/rollouts/rollout_table.h"

namespace handsim::study {

using NamedCells = std::vector<std::pair<std::string, Cell>>;

/// Figures and verdicts up to now: `joint_gap[m]`, `joint_gap.held`, those of grasps (forces by part) and
/// climbs, and the activations of muscles, also as the mean of their squares, `effort`.
NamedCells figures_of(const simulation::Simulation& simulation);

/// Adds a row of curves: the hands' angles, torques about driven axes, activations, and the normal forces of
/// the parts of hands where the scene has contacts with forces.
void add_curves(const simulation::Simulation& simulation, TimeSeries& to);

/// The numbers of summary.json that the motion alone decides, by their path: items of lists by their `name`,
/// `part` or pair (`contact_forces.fingers.right.index.mean_normal_force_N`); true is 1.
std::map<std::string, double> summary_figures(const simulation::Simulation& simulation);

/// Every grasp is held; without a grasp, every criterion. Nothing where nothing is judged.
std::optional<bool> is_held(const simulation::Simulation& simulation, bool diverged);

/// Why a run has ended that did not diverge: `end`, or `decided` (an object has moved too far or is lost).
std::string ended(const simulation::Simulation& simulation);

}  // namespace handsim::study
