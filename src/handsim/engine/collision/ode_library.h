// ODE as a library: its initialisation, error handlers, and owners of what it hands out. Every engine borrows
// its collision tests. ODE's errors, which abort by default, become the exception OdeFault, thrown through
// ODE's frames (in no documented contract; tests/engine/ode/faults_test.cpp holds it up); messages are
// counted, not printed. Memory that ODE does not get is such an error too.
#pragma once

#include <string>

#include <ode/ode.h>

#include "handsim/model/model.h"

namespace handsim::engine {

/// The error that ODE reported before it would have exited or aborted. The world it happened in may only be
/// destroyed.
struct OdeFault {
  int number = 0;       ///< ODE's error number
  std::string message;  ///< ODE's text, with file and line of its source where it gives them
};

inline constexpr int kNoMemory = -1;  ///< Number of the fault of memory that ODE did not get.

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

/// Creates the geom of a shape, its index as user data, at the origin. @throws OdeFault
dGeomID make_geom(dSpaceID space, const model::Shape& shape, std::size_t index);

/// Fixes a geom to the ODE body of its shape. Planes cannot be.
void fix_geom(dGeomID geom, const model::Shape& shape, dBodyID body);

/// Puts a geom that is fixed to nothing where its shape is at a pose of its body.
void place_geom(dGeomID geom, const model::Shape& shape, const Pose& x_WB);
/// Places a geom at a pose of the shape itself, not of its body.
void place_shape(dGeomID geom, const model::Shape& shape, const Pose& x_WS);

inline std::size_t shape_index(dGeomID geom) { return reinterpret_cast<std::size_t>(dGeomGetData(geom)); }

}  // namespace handsim::engine
