#include "handsim/engine/collision/ode_library.h"

#include <array>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <mutex>

#include <ode/ode.h>

namespace handsim::engine {

namespace {

thread_local int lcp_failure_count = 0;

[[noreturn]] void throw_fault(int number, const char* format, va_list arguments) {
  std::array<char, 512> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  throw OdeFault{number, text.data()};
}

extern "C" void handsim_ode_fault(int number, const char* format, va_list arguments) {
  throw_fault(number, format, arguments);
}

extern "C" void handsim_ode_message(int number, const char* /*format*/, va_list /*arguments*/) {
  if (number == d_ERR_LCP) ++lcp_failure_count;
}

/// ODE does not test what it is given.
extern "C" void* handsim_ode_allocate(dsizeint size) {
  void* block = std::malloc(size);
  if (block == nullptr) throw OdeFault{kNoMemory, "out of memory"};
  return block;
}

extern "C" void* handsim_ode_reallocate(void* block, dsizeint /*old_size*/, dsizeint size) {
  void* larger = std::realloc(block, size);
  if (larger == nullptr) throw OdeFault{kNoMemory, "out of memory"};
  return larger;
}

void initialise_process() {
  dSetAllocHandler(handsim_ode_allocate);
  dSetReallocHandler(handsim_ode_reallocate);
  dInitODE2(0);
  dSetErrorHandler(handsim_ode_fault);
  dSetDebugHandler(handsim_ode_fault);
  dSetMessageHandler(handsim_ode_message);
}

struct ThreadData {
  ThreadData() {
    static std::mutex mutex;
    static bool initialised = false;
    const std::lock_guard lock(mutex);
    if (!initialised) initialise_process();
    initialised = true;
    // Freed by ODE with the thread where it is per thread; Debian's build has one set for all threads,
    // which no thread may clean up under the others.
    dAllocateODEDataForThread(static_cast<unsigned>(dAllocateMaskAll));
  }
};

}  // namespace

void enter_ode() {
  thread_local const ThreadData data;
  static_cast<void>(data);
}

int lcp_failures() { return lcp_failure_count; }

}  // namespace handsim::engine
