// The kernels that every machine of the architecture runs: one lane, and the narrowest vector register where
// there is no wider one.
#include "handsim/engine/articulated/kernels/kernel.h"
#include "handsim/engine/articulated/kernels/kernel_table.h"
#include "handsim/engine/articulated/kernels/row_operations.h"

namespace handsim::engine::articulated {

const Kernel kScalarKernel = make_kernel<double>("1 lane");

using Number = stdx::native_simd<double>;

#if !defined(HANDSIM_AVX2_KERNEL)
const Kernel kBaselineKernel = make_kernel<Number>("vector unit of the build");
#endif
const RowKernel kBaselineRows = RowOperations<Number>::kernel();

}  // namespace handsim::engine::articulated
