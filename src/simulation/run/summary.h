// A run's outcome as summary.json: what the run itself knows, and the parts of its watchers.
#pragma once

#include <string>

#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"

namespace handsim::simulation {

/// Text of summary.json. `simulation` may have stopped early; `result.fault` says so.
std::string summary_json(const Simulation& simulation, const RunResult& result);

}  // namespace handsim::simulation
