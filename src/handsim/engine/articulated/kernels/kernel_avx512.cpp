// Built with -mavx512f -mavx512dq -mavx512vl; run only where the processor has them.
#include "handsim/engine/articulated/kernels/kernel.h"
#include "handsim/engine/articulated/kernels/kernel_table.h"
#include "handsim/engine/articulated/kernels/row_operations.h"

namespace handsim::engine::articulated {

using Number = stdx::native_simd<double>;
static_assert(Number::size() == 8);

const Kernel kAvx512Kernel = make_kernel<Number>("8 lanes (AVX-512)");
const RowKernel kAvx512Rows = RowOperations<Number>::kernel();

}  // namespace handsim::engine::articulated
