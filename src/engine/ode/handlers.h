// All of ODE's process-wide state in one place: initialisation, error handlers, random seed. ODE aborts
// the process on errors and prints messages by default; here errors become the exception OdeFault,
// thrown through ODE's frames (not in ODE's documented contract; tests/engine/handlers_test.cpp holds it
// up), and messages are counted and not printed. Memory that ODE does not get is such an error too.
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>

struct dxThreadingImplementation;
struct dxWorld;

namespace handsim::engine::ode {

/// What ODE reported before it would have exited or aborted. The world it happened in may only be destroyed.
struct OdeFault {
  int number = 0;       ///< ODE's error number
  std::string message;  ///< ODE's text, with file and line of its source where it gives them
};

/// Number of the fault of memory that ODE did not get.
inline constexpr int kNoMemory = -1;

/// Has the memory of the world's steps tested before it is taken: a step that needs more than there is is not
/// made (dWorldStep and dWorldQuickStep return 0), and the world stays as it was.
void guard_step_memory(dxWorld* world);

/// What the last step that was not made in the calling thread asked for and could have had [bytes].
struct RefusedMemory {
  std::size_t needed = 0, free = 0;
};
RefusedMemory refused_memory();

/// Makes ODE ready for the calling thread: initialises ODE and installs the handlers on the first call in
/// the process, allocates ODE's data for a thread on its first call there. Every later call costs about 1 ns.
void enter_ode();

/// Keeps what a fault in the middle of a step has left with work undone: ODE ends the process where it is
/// freed. A few hundred bytes for each fault, held until the process ends.
void abandon(dxThreadingImplementation* threading);

/// How often the direct solver has given up in the calling thread since it started (d_ERR_LCP messages).
int lcp_failures();

/// Gives ODE's process-wide random generator a seed for as long as this lives, then puts the old one back.
/// Lives are exclusive: quick_step steps of all threads run one after the other, because ODE has a single
/// generator and bit-reproducibility is promised. An uncontended lock costs about 20 ns. Parallel
/// quick_step runs belong in separate processes.
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
