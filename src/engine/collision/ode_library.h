// ODE as a library: its initialisation, its error handlers, and owners of what it hands out. Every engine
// borrows its collision tests. ODE aborts the process on errors and prints messages by default; here errors
// become the exception OdeFault, thrown through ODE's frames (not in ODE's documented contract;
// tests/engine/ode/faults_test.cpp holds it up), and messages are counted and not printed. Memory that ODE
// does not get is such an error too.
#pragma once

#include <string>

namespace handsim::engine {

/// What ODE reported before it would have exited or aborted. The world it happened in may only be destroyed.
struct OdeFault {
  int number = 0;       ///< ODE's error number
  std::string message;  ///< ODE's text, with file and line of its source where it gives them
};

/// Number of the fault of memory that ODE did not get.
inline constexpr int kNoMemory = -1;

template <auto Destroy>
struct Destroyer {
  template <class T>
  void operator()(T* id) const {
    Destroy(id);
  }
};

/// Makes ODE ready for the calling thread: initialises ODE and installs the handlers on the first call in
/// the process, allocates ODE's data for a thread on its first call there. Every later call costs about 1 ns.
void enter_ode();

/// How often the direct solver has given up in the calling thread since it started (d_ERR_LCP messages).
int lcp_failures();

}  // namespace handsim::engine
