// The state of a simulation in memory, from which it can continue. Files of it: run/snapshot_file.h.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/model/state.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::simulation {

/// Identifies a simulation's scene and mathematics library, so that no other restores its snapshots: name and
/// hash of each part that motion depends on. Not title, duration, recording, pictures, criteria.
using Fingerprint = std::vector<std::pair<std::string, std::uint64_t>>;

Fingerprint fingerprint(const scene::Scene& scene, const engine::Engine& engine);

/// Names of parts that differ or that only one has; empty if there are none.
std::vector<std::string> differences(const Fingerprint& a, const Fingerprint& b);

/// The mathematics library and a hash of results of its functions at fixed arguments, e.g. `glibc 2.36,
/// results 1f2e3d4c`: runs of one build have the same bits if this is the same. glibc has several versions of
/// each function: without fused multiply-add, the last bits of results differ.
const std::string& mathematics();

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
