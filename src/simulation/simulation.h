// A scene in motion: one engine, stepped and watched. The loop and nothing else: files and pictures are
// run.h's.
#pragma once

#include <memory>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/scene/scene.h"
#include "handsim/simulation/contact_sums.h"
#include "handsim/simulation/grasp_figures.h"
#include "handsim/simulation/ledger.h"
#include "handsim/simulation/monitor.h"
#include "handsim/simulation/tracking.h"

namespace handsim::simulation {

/// An object that starts inside a hand would be shot out of it. @throws Error (input) naming all such.
void check_start(const scene::Scene& scene);

class Simulation {
 public:
  /// The scene must outlive the simulation.
  /// @throws Error (input) where the engine refuses the model, or an object starts more than 1 mm inside a
  /// hand that it can touch and is not allowed to.
  explicit Simulation(const scene::Scene& scene);

  /// One step of the scene's solver: control, collide, step, sense, check.
  /// @throws Error (physics) with time, body or joint and quantity when the state leaves its bounds.
  void step();

  const model::State& state() const { return engine_->state(); }
  const model::Model& model() const { return scene_.model; }
  const engine::Engine& engine() const { return *engine_; }
  const Monitor& monitor() const { return monitor_; }
  /// Null where the scene drives no joint.
  const control::Controller* controller() const { return controller_ ? &*controller_ : nullptr; }
  /// Figures of the driven axes up to now, holds that are under way closed.
  std::vector<AxisTracking> tracking() const;
  const Ledger& ledger() const { return ledger_; }
  /// Figures of the scene's grasps up to now.
  std::vector<GraspFigures> grasps() const;
  /// An object of a grasp is lost already.
  bool grasp_lost() const;
  /// Null where the scene does not record contacts.
  const ContactSums* contact_sums() const { return contact_sums_ ? &*contact_sums_ : nullptr; }
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  /// Steps that the scene's duration takes.
  long step_count() const;

 private:
  void find_constant_torques();
  engine::StepInput command();

  const scene::Scene& scene_;
  std::unique_ptr<engine::Engine> engine_;
  std::optional<control::Controller> controller_;
  std::optional<Tracking> tracking_;
  std::vector<GraspWatch> grasps_;
  Monitor monitor_;
  Ledger ledger_;
  std::optional<ContactSums> contact_sums_;
  std::vector<double> constant_;  ///< constant torques of the joints; empty where there are none
  std::vector<double> sum_;       ///< with the controller's
};

}  // namespace handsim::simulation
