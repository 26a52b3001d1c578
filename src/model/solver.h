// How an engine is to advance a model: what scenes state and engines obey.
#pragma once

#include <cstdint>

#include "handsim/model/effects.h"

namespace handsim::model {

enum class Method {
  world_step,  ///< ODE's direct LCP solver (Dantzig): exact, cost grows with the cube of the rows
  /// ODE's iterative solver (projected SOR): cost grows with rows times iterations. Reproducible bit for bit,
  /// for which the quick_step steps of several threads take turns (ODE has one random generator).
  quick_step,
};

struct SolverSettings {
  Method method = Method::world_step;
  double step = 1e-3;  ///< [s], above 0 to 0.1
  /// Share of a joint's positional error that one step corrects, 0..1. Low: joints drift apart under
  /// load; high (above about 0.8): jitter, and rebound at stops.
  double erp = 0.2;
  /// Constraint force mixing (softness of every constraint row), above 0 to 1. Low: redundant rows make the
  /// LCP fail; high: joints feel like rubber.
  double cfm = 1e-9;
  int iterations = 20;     ///< quick_step only
  std::uint64_t seed = 1;  ///< quick_step shuffles its rows with ODE's random generator
  Effects effects;
};

}  // namespace handsim::model
