// A scene in motion: one engine, stepped and watched. The loop and nothing else: files and pictures are
// run.h's.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/scene/compile/scene.h"
#include "handsim/simulation/run/snapshot.h"
#include "handsim/simulation/watch/climb_figures.h"
#include "handsim/simulation/watch/contact_sums.h"
#include "handsim/simulation/watch/convergence.h"
#include "handsim/simulation/watch/grasp_figures.h"
#include "handsim/simulation/watch/ledger.h"
#include "handsim/simulation/watch/monitor.h"
#include "handsim/simulation/watch/state_hash.h"
#include "handsim/simulation/watch/tracking.h"
#include "handsim/simulation/watch/tunnelling.h"

namespace handsim::simulation {

/// An object that starts inside a hand would be shot out of it. @throws Error (input) naming all such.
void check_start(const scene::Scene& scene);

/// Joints further apart than this are joints no more: a hand's bodies are no longer [m].
inline constexpr double kLargestGap = 0.1;

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
  const Convergence& convergence() const { return convergence_; }
  /// Null where no contacts are tested.
  const Tunnelling* tunnelling() const { return tunnelling_ ? &*tunnelling_ : nullptr; }
  /// What of the run is bad enough to be told, one sentence each.
  std::vector<std::string> warnings() const;
  /// Steps made since the start of the scene, before a snapshot too.
  long steps() const { return ledger_.steps(); }
  /// Of the states up to now (state_hash.h).
  std::uint64_t state_hash() const;

  /// All that the rest of the run depends on and all that it has measured. Costs some microseconds, the first
  /// one of a simulation some milliseconds. @throws Error (physics) of a simulation that has failed.
  RunSnapshot snapshot() const;
  /// Goes on from a snapshot of the same scene, to the bit as if the run had never stopped. Wall times in the
  /// ledger are those of both.
  /// @throws Error (input) naming what differs where the snapshot is of another scene, settings or engine, or
  ///         where it does not hold together; the simulation then stands where it stood.
  void restore(const RunSnapshot& snapshot);

  /// Figures of the scene's grasps up to now.
  std::vector<GraspFigures> grasps() const;
  /// An object of a grasp is lost already.
  bool grasp_lost() const;
  /// Figures of the scene's climbs up to now.
  std::vector<ClimbFigures> climbs() const;
  const std::vector<ClimbWatch>& climb_watches() const { return climbs_; }
  /// There is nothing left to see: every climb has failed, and the scene has no grasp.
  bool over() const;
  /// Null where the scene does not record contacts.
  const ContactSums* contact_sums() const { return contact_sums_ ? &*contact_sums_ : nullptr; }
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  /// Steps that the scene's duration takes.
  long step_count() const;

 private:
  void advance();
  void restore_parts(const RunSnapshot& snapshot);
  void find_constant_torques();
  engine::StepInput command();

  const scene::Scene& scene_;
  std::unique_ptr<engine::Engine> engine_;
  std::optional<Error> failure_;  ///< what the engine did not see
  std::optional<control::Controller> controller_;
  std::optional<Tracking> tracking_;
  std::vector<GraspWatch> grasps_;
  std::vector<ClimbWatch> climbs_;
  Monitor monitor_;
  Ledger ledger_;
  Convergence convergence_;
  std::optional<Tunnelling> tunnelling_;
  StateHash hash_;                                          ///< up to the last step that kHashEvery divides
  mutable std::shared_ptr<const Fingerprint> fingerprint_;  ///< made when first asked for
  std::optional<ContactSums> contact_sums_;
  std::vector<double> constant_;      ///< constant torques of the joints; empty where there are none
  std::vector<double> sum_;           ///< with the controller's and the climbs'
  std::vector<model::Servo> servos_;  ///< the controller's and the climbs'
};

}  // namespace handsim::simulation
