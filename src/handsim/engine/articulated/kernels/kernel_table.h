// The kernels of this build, each in a file of its own instruction set.
#pragma once

#include "handsim/engine/articulated/kernels/lane_tree.h"
#include "handsim/engine/articulated/kernels/row_kernel.h"

namespace handsim::engine::articulated {

extern const Kernel kScalarKernel;
extern const Kernel kBaselineKernel;
extern const Kernel kAvx2Kernel;
extern const Kernel kAvx512Kernel;
extern const RowKernel kBaselineRows;
extern const RowKernel kAvx2Rows;
extern const RowKernel kAvx512Rows;

}  // namespace handsim::engine::articulated
