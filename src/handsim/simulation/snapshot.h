// The state of a simulation in memory, from which it can continue. Files of it: run/snapshot_file.h.
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

/// Only the motion (engine, controller and muscle drive), to reset simulations of one scene or its copies.
class MotionSnapshot {
 public:
  /// Time of the state [s].
  double time() const { return state_.time; }

 private:
  friend class Simulation;
  std::shared_ptr<const char> lineage_;  ///< scene::Scene::lineage
  long steps_ = 0;
  model::State state_;
  std::string bytes_;  ///< data of Simulation::save_motion
};

}  // namespace handsim::simulation
