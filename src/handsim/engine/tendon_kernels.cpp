// The kernel that every machine of the architecture runs, and the table of all.
#include "handsim/engine/tendon_kernels.h"

#include "handsim/engine/tendon_operations.h"

namespace handsim::engine {

#if defined(HANDSIM_AVX2_TENDONS)
extern const TendonKernel kAvx2Tendons;
#endif
static const TendonKernel kBaselineTendons =
    TendonOperations<model::stdx::native_simd<double>>::kernel("vector unit of the build");

std::vector<const TendonKernel*> tendon_kernels() {
  std::vector<const TendonKernel*> out = {&kBaselineTendons};
#if defined(HANDSIM_AVX2_TENDONS)
  if (__builtin_cpu_supports("avx2")) out.push_back(&kAvx2Tendons);
#endif
  return out;
}

}  // namespace handsim::engine
