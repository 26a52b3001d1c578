#include "handsim/engine/ode/handlers.h"

#include <array>
#include <cstdarg>
#include <cstdio>
#include <vector>

#include <ode/ode.h>

namespace handsim::engine::ode {

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

void initialise_process() {
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

std::mutex& random_mutex() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace

void enter_ode() {
  thread_local const ThreadData data;
  static_cast<void>(data);
}

void abandon(dxThreadingImplementation* threading) {
  static std::mutex mutex;
  // Never freed, and so never destroyed at the process's end either.
  static auto* const kept = new std::vector<dxThreadingImplementation*>;
  const std::lock_guard lock(mutex);
  kept->push_back(threading);
}

int lcp_failures() { return lcp_failure_count; }

RandomSeed::RandomSeed(std::uint64_t seed) : lock_(random_mutex()), previous_(dRandGetSeed()) {
  dRandSetSeed(static_cast<unsigned long>(seed));
}

RandomSeed::~RandomSeed() { dRandSetSeed(previous_); }

}  // namespace handsim::engine::ode
