// What a run has to say for itself, as summary.json.
#pragma once

#include <string>

#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"

namespace handsim::simulation {

/// Figures of a finished run beside the scene's criteria.
std::vector<Verdict> verdicts(const Simulation& simulation, const scene::Criteria& criteria);

/// Text of summary.json. `simulation` may have stopped early; `result.fault` says so.
std::string summary_json(const scene::Scene& scene, const Simulation& simulation, const RunResult& result);

}  // namespace handsim::simulation
