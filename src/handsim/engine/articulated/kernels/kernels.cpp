#include <vector>

#include "handsim/engine/articulated/kernels/kernel_table.h"
#include "handsim/engine/articulated/kernels/kernels.h"

namespace handsim::engine::articulated {

// Not in the kernels' own files: what the standard library instantiates there is of their instruction sets.
template <int W>
Work<W>* thread_work(std::size_t count) {
  thread_local std::vector<Work<W>> works;
  if (works.size() < count) works.resize(count);
  return works.data();
}
template <int W>
Work3<W>* thread_work3(std::size_t count) {
  thread_local std::vector<Work3<W>> works;
  if (works.size() < count) works.resize(count);
  return works.data();
}
template Work<1>* thread_work<1>(std::size_t);
template Work<2>* thread_work<2>(std::size_t);
template Work<4>* thread_work<4>(std::size_t);
template Work<8>* thread_work<8>(std::size_t);
template Work3<1>* thread_work3<1>(std::size_t);
template Work3<2>* thread_work3<2>(std::size_t);
template Work3<4>* thread_work3<4>(std::size_t);
template Work3<8>* thread_work3<8>(std::size_t);

namespace {

#if defined(HANDSIM_AVX2_KERNEL)
bool has_avx2() { return __builtin_cpu_supports("avx2"); }
#endif
#if defined(HANDSIM_AVX512_KERNEL)
bool has_avx512() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
         __builtin_cpu_supports("avx512vl");
}
#endif

}  // namespace

std::vector<const Kernel*> kernels() {
  std::vector<const Kernel*> out = {&kScalarKernel};
#if defined(HANDSIM_AVX2_KERNEL)
  if (has_avx2()) out.push_back(&kAvx2Kernel);
#else
  if (kBaselineKernel.width > 1) out.push_back(&kBaselineKernel);
#endif
#if defined(HANDSIM_AVX512_KERNEL)
  if (has_avx512()) out.push_back(&kAvx512Kernel);
#endif
  return out;
}

std::vector<const RowKernel*> row_kernels() {
  std::vector<const RowKernel*> out = {&kBaselineRows};
#if defined(HANDSIM_AVX2_KERNEL)
  if (has_avx2()) out.push_back(&kAvx2Rows);
#endif
#if defined(HANDSIM_AVX512_KERNEL)
  if (has_avx512()) out.push_back(&kAvx512Rows);
#endif
  return out;
}

const RowKernel& row_kernel() {
  static const RowKernel* const fastest = row_kernels().back();
  return *fastest;
}

const Kernel& choose_kernel(const std::vector<int>& level_sizes) {
  const Kernel* best = &kScalarKernel;
  double least = 0;
  for (const Kernel* kernel : kernels()) {
    // Wider costs more: cache lines, slower divisions. 6 % per lane is chosen, not measured.
    double cost = 0;
    for (const int size : level_sizes) cost += (size + kernel->width - 1) / kernel->width;
    cost *= 1 + 0.06 * (kernel->width - 1);
    if (kernel->width > 1 && !(cost < least)) continue;
    best = kernel;
    least = cost;
  }
  return *best;
}

}  // namespace handsim::engine::articulated
