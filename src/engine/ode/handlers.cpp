#include "handsim/engine/ode/handlers.h"

#include <array>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include <ode/ode.h>

#include "handsim/core/memory.h"

namespace handsim::engine::ode {

namespace {

thread_local int lcp_failure_count = 0;
thread_local RefusedMemory refused;

/// Smaller blocks are taken without a look at what is free [bytes].
constexpr std::size_t kSmallBlock = std::size_t{16} << 20;

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

/// Of a step. Linux grants memory that it does not have and ends the process that uses it: hence the test.
extern "C" void* handsim_ode_step_block(dsizeint size) {
  if (size > kSmallBlock)
    if (const auto free = free_memory(); free && *free < size) {
      refused = {size, *free};
      return nullptr;
    }
  void* block = std::malloc(size);
  if (block == nullptr) refused = {size, free_memory().value_or(0)};
  return block;
}

extern "C" void* handsim_ode_shrink_step_block(void* block, dsizeint /*size*/, dsizeint smaller) {
  return std::realloc(block, smaller);
}

extern "C" void handsim_ode_free_step_block(void* block, dsizeint /*size*/) { std::free(block); }

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

void guard_step_memory(dxWorld* world) {
  const dWorldStepMemoryFunctionsInfo functions = {sizeof(dWorldStepMemoryFunctionsInfo),
                                                   handsim_ode_step_block, handsim_ode_shrink_step_block,
                                                   handsim_ode_free_step_block};
  dWorldSetStepMemoryManager(world, &functions);
}

RefusedMemory refused_memory() { return refused; }

RandomSeed::RandomSeed(std::uint64_t seed) : lock_(random_mutex()), previous_(dRandGetSeed()) {
  dRandSetSeed(static_cast<unsigned long>(seed));
}

RandomSeed::~RandomSeed() { dRandSetSeed(previous_); }

}  // namespace handsim::engine::ode
