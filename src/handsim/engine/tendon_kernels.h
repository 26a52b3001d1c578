// The tendon kernels of this build, each in a file of its own instruction set.
#pragma once

#include <vector>

#include "handsim/engine/tendon_lanes.h"

namespace handsim::engine {

/// All tendon kernels that this processor runs, narrowest first.
std::vector<const TendonKernel*> tendon_kernels();

}  // namespace handsim::engine
