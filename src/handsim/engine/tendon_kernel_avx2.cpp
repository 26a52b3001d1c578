// Built with -mavx2; run only where the processor has it.
#include "handsim/engine/tendon_operations.h"

namespace handsim::engine {

using Number = model::stdx::native_simd<double>;
static_assert(Number::size() == 4);

extern const TendonKernel kAvx2Tendons;
const TendonKernel kAvx2Tendons = TendonOperations<Number>::kernel("4 lanes (AVX2)");

}  // namespace handsim::engine
