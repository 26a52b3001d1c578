// Built with -mavx2; run only where the processor has it.
#include "handsim/engine/articulated/kernels/kernel.h"
#include "handsim/engine/articulated/kernels/kernel_table.h"
#include "handsim/engine/articulated/kernels/row_operations.h"

namespace handsim::engine::articulated {

using Number = stdx::native_simd<double>;
static_assert(Number::size() == 4);

const Kernel kAvx2Kernel = make_kernel<Number>("4 lanes (AVX2)");
const RowKernel kAvx2Rows = RowOperations<Number>::kernel();

}  // namespace handsim::engine::articulated
