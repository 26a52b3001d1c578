#include "handsim/engine/ode/world_resources.h"

#include <cstdlib>
#include <vector>

#include <ode/ode.h>

#include "handsim/core/memory.h"

namespace handsim::engine::ode {

namespace {

thread_local RefusedMemory refused;

/// Smaller blocks are taken without asking what is free [bytes].
constexpr std::size_t kSmallBlock = std::size_t{16} << 20;

/// Memory for a step. Linux grants memory that it lacks and ends the process that uses it: hence the test.
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

constinit std::mutex random_mutex;

}  // namespace

void abandon(dxThreadingImplementation* threading) {
  static std::mutex mutex;
  // Never freed, and so never destroyed at the process's end either.
  static auto* const kept = new std::vector<dxThreadingImplementation*>;
  const std::lock_guard lock(mutex);
  kept->push_back(threading);
}

void guard_step_memory(dxWorld* world) {
  const dWorldStepMemoryFunctionsInfo functions = {sizeof(dWorldStepMemoryFunctionsInfo),
                                                   handsim_ode_step_block, handsim_ode_shrink_step_block,
                                                   handsim_ode_free_step_block};
  dWorldSetStepMemoryManager(world, &functions);
}

RefusedMemory refused_memory() { return refused; }

RandomSeed::RandomSeed(std::uint64_t seed) : lock_(random_mutex), previous_(dRandGetSeed()) {
  dRandSetSeed(static_cast<unsigned long>(seed));
}

RandomSeed::~RandomSeed() { dRandSetSeed(previous_); }

}  // namespace handsim::engine::ode
