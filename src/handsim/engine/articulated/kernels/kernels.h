// The kernels there are, and which of them fits a model.
#pragma once

#include <vector>

#include "handsim/engine/articulated/kernels/batch.h"

namespace handsim::engine::articulated {

/// The fastest kernel that this processor runs. @param level_sizes numbers of nodes of one kind and depth.
const Kernel& choose_kernel(const std::vector<int>& level_sizes);
/// All kernels that this processor runs, narrowest first.
std::vector<const Kernel*> kernels();

}  // namespace handsim::engine::articulated
