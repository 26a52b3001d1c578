// Which mathematics library rounds a run's sines and powers. glibc has several of each function and takes
// those that the processor can run: where it lacks fused multiply-add, last bits differ, and with them a run.
#pragma once

#include <string>

namespace handsim::simulation {

/// Name and version of the library and a hash of what its functions give at fixed arguments, e.g.
/// `glibc 2.36, results 1f2e3d4c`: runs of one build repeat to the bit where this is the same.
const std::string& mathematics();

}  // namespace handsim::simulation
