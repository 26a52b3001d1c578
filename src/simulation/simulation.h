// A scene in motion: one engine, stepped and watched. The loop and nothing else: files and pictures are
// run.h's.
#pragma once

#include <memory>

#include "handsim/engine/engine.h"
#include "handsim/scene/scene.h"
#include "handsim/simulation/ledger.h"
#include "handsim/simulation/monitor.h"

namespace handsim::simulation {

class Simulation {
 public:
  /// The scene must outlive the simulation.
  /// @throws Error (input) where the engine refuses the model.
  explicit Simulation(const scene::Scene& scene);

  /// One step of the scene's solver: collide, step, check.
  /// @throws Error (physics) with time, body or joint and quantity when the state leaves its bounds.
  void step();

  const model::State& state() const { return engine_->state(); }
  const model::Model& model() const { return scene_.model; }
  const engine::Engine& engine() const { return *engine_; }
  const Monitor& monitor() const { return monitor_; }
  const Ledger& ledger() const { return ledger_; }
  /// Steps that the scene's duration takes.
  long step_count() const;

 private:
  const scene::Scene& scene_;
  std::unique_ptr<engine::Engine> engine_;
  Monitor monitor_;
  Ledger ledger_;
  std::vector<double> torques_;  ///< constant torques of the joints; empty without actuation
};

}  // namespace handsim::simulation
