// How much memory the test program has had.
#pragma once

#include <sys/resource.h>

#include "support/sanitized.h"

#ifdef HANDSIM_ADDRESS_SANITIZED
#include <sanitizer/allocator_interface.h>
#endif

namespace handsim::test {

/// Largest memory that the process has had [bytes]; under the address sanitizer, which keeps what is freed
/// for a while, the memory that is allocated.
inline double peak_memory() {
#ifdef HANDSIM_ADDRESS_SANITIZED
  return static_cast<double>(__sanitizer_get_current_allocated_bytes());
#else
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024 * static_cast<double>(usage.ru_maxrss);
#endif
}

}  // namespace handsim::test
