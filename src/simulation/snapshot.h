// A simulation at one moment, to go on from in memory; run/snapshot_file.h makes files of them.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "handsim/model/state.h"
#include "handsim/simulation/fingerprint.h"

namespace handsim::simulation {

/// A run: the motion and all that its watchers have measured. Goes from one process to another.
struct RunSnapshot {
  std::shared_ptr<const Fingerprint> scene;
  double time = 0;        ///< of the state [s]
  std::string bytes;      ///< Simulation's own
  std::uint64_t sum = 0;  ///< XXH64 of the bytes
};

/// The motion alone, engine and controller, for a cheap reset of simulations of one scene or copies of it.
class MotionSnapshot {
 public:
  /// Of the state [s].
  double time() const { return state_.time; }

 private:
  friend class Simulation;
  std::shared_ptr<const char> lineage_;  ///< scene::Scene::lineage
  long steps_ = 0;
  model::State state_;
  std::string bytes_;  ///< what the engine and then the controller save
};

}  // namespace handsim::simulation
