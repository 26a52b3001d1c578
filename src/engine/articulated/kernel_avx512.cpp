// Built with -mavx512f -mavx512dq -mavx512vl; run only where the processor has them.
#include "handsim/engine/articulated/kernel.h"
#include "handsim/engine/articulated/kernel_table.h"

namespace handsim::engine::articulated {

using Number = stdx::native_simd<double>;
static_assert(Number::size() == 8);

const Kernel kAvx512Kernel = Lanes<Number>::kernel("8 lanes (AVX-512)");

}  // namespace handsim::engine::articulated
