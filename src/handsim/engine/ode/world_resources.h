// What steps of ODE's worlds take of the process: memory, threading, and the one random generator.
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>

struct dxThreadingImplementation;
struct dxWorld;

namespace handsim::engine::ode {

/// Has the memory of the world's steps tested before it is taken: a step that needs more than there is is not
/// made (dWorldStep and dWorldQuickStep return 0), and the world stays as it was.
void guard_step_memory(dxWorld* world);

/// Memory of the last step of the calling thread that was not made: needed and free [bytes].
struct RefusedMemory {
  std::size_t needed = 0, free = 0;
};
RefusedMemory refused_memory();

/// Keeps what a fault in the middle of a step has left with work undone: ODE ends the process where it is
/// freed. A few hundred bytes for each fault, held until the process ends.
void abandon(dxThreadingImplementation* threading);

/// Gives ODE's one process-wide random generator a seed while this lives, then puts the old one back. Lives
/// are exclusive, for bit-reproducibility: quick_step steps of all threads take turns. An uncontended lock
/// costs about 20 ns. Parallel quick_step runs belong in separate processes.
class RandomSeed {
 public:
  explicit RandomSeed(std::uint64_t seed);
  ~RandomSeed();
  RandomSeed(const RandomSeed&) = delete;
  RandomSeed& operator=(const RandomSeed&) = delete;

 private:
  std::lock_guard<std::mutex> lock_;
  unsigned long previous_;
};

}  // namespace handsim::engine::ode
