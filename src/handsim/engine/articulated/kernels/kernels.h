// The kernels there are, and which of them fits a model.
#pragma once

#include <vector>

#include "handsim/engine/articulated/kernels/lane_tree.h"
#include "handsim/engine/articulated/kernels/row_kernel.h"

namespace handsim::engine::articulated {

/// The fastest kernel that this processor runs. @param level_sizes numbers of nodes of one kind and depth.
const Kernel& choose_kernel(const std::vector<int>& level_sizes);
/// All kernels that this processor runs, narrowest first.
std::vector<const Kernel*> kernels();

/// The fastest kernel of rows that this processor runs.
const RowKernel& row_kernel();
/// All kernels of rows that this processor runs, narrowest first.
std::vector<const RowKernel*> row_kernels();

}  // namespace handsim::engine::articulated
