// The state of a simulation in memory, from which it can continue; run/snapshot_file.h writes and reads
// files.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "handsim/model/state.h"
#include "handsim/simulation/fingerprint.h"

namespace handsim::simulation {

/// A run: the motion and the measurements of its watchers. Can be used in another process.
struct RunSnapshot {
  std::shared_ptr<const Fingerprint> scene;
  double time = 0;        ///< of the state [s]
  std::string bytes;      ///< data of Simulation
  std::uint64_t sum = 0;  ///< XXH64 of the bytes
};

/// Only the motion (engine and controller), for a fast reset of simulations that share one scene object.
class MotionSnapshot {
 public:
  /// Time of the state [s].
  double time() const { return state_.time; }

 private:
  friend class Simulation;
  std::shared_ptr<const scene::Scene> scene_;
  long steps_ = 0;
  model::State state_;
  std::string bytes_;  ///< data of the engine, then of the controller
};

}  // namespace handsim::simulation
