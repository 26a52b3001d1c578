// The text of summary.json: figures of the run and of its watchers.
#pragma once

#include <string>

#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"

namespace handsim::simulation {

/// Text of summary.json, also of a run that a fault stopped (`result.fault`).
std::string summary_json(const Simulation& simulation, const RunResult& result);

}  // namespace handsim::simulation
