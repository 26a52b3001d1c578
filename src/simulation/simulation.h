// A scene in motion: command, step, and watchers of each step. Files and pictures are run/run.h's.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/scene/compile/scene.h"
#include "handsim/simulation/climb_load.h"
#include "handsim/simulation/snapshot.h"
#include "handsim/simulation/watch/standard_watchers.h"

namespace handsim::simulation {

/// Refuses objects that start inside a hand: contact would throw them out. @throws Error (input) naming all.
void check_start(const scene::Scene& scene);

/// Can be moved. Const methods may be called from several threads at once.
class Simulation {
 public:
  /// Shares the scene. @param watchers makes those that it is to have: standard_watchers, no_watchers,
  /// `only<Monitor, RunHash>` or the caller's own. Without any the loop costs what its engine costs.
  /// @throws Error (input) where the engine refuses the model, or an object starts more than 1 mm inside a
  /// hand that it can touch and is not allowed to.
  explicit Simulation(std::shared_ptr<const scene::Scene> scene, MakeWatchers watchers = standard_watchers);
  /// The same of a scene of its own.
  explicit Simulation(scene::Scene scene, MakeWatchers watchers = standard_watchers)
      : Simulation(std::make_shared<const scene::Scene>(std::move(scene)), std::move(watchers)) {}

  /// One step of the scene's solver: command, step, sense, watch.
  /// @param action of the caller, for this step alone: torques [N m] or forces [N] that add to those of the
  ///        scene, and servos, which replace those of the scene on coordinates where their limit is above 0.
  ///        Each of size model().dof_count() or empty, in the order of the coordinates (Joint::first_dof),
  ///        positive along the coordinate. Servos need the actuation effect (spec.solver.effects). Forces on
  ///        bodies, and targets of driven bodies in place of their motions.
  /// @param angles [rad] that the controller is to hold at the step's end, one for each of its axes; empty:
  ///        those of the scene's poses
  /// @throws Error (input) for an action of another size, with numbers that are not finite or out of range,
  ///         or for servos without actuation; nothing has moved then. Error (physics) with time, body or
  ///         joint and quantity when the state leaves its bounds; every later step throws the same.
  void step(const engine::StepInput& action = {}, std::span<const double> angles = {});

  const scene::Scene& scene() const { return *scene_; }
  const model::Model& model() const { return scene_->model; }
  const model::State& state() const { return engine_->state(); }
  const engine::Engine& engine() const { return *engine_; }
  /// Null where the scene drives no joint.
  const control::Controller* controller() const { return controller_.get(); }
  /// Steps made since the start of the scene, before a snapshot too.
  long steps() const { return steps_; }
  /// Steps that the scene's duration takes.
  long step_count() const;

  const Watchers& watchers() const { return watchers_; }
  /// Null where the simulation has no such watcher. A reset ends the reference, a restore does not.
  template <class Kind>
  const Kind* find() const {
    for (const auto& watcher : watchers_)
      if (const auto* found = dynamic_cast<const Kind*>(watcher.get())) return found;
    return nullptr;
  }
  /// @throws Error (input) where the simulation has no such watcher.
  template <class Kind>
  const Kind& get() const {
    const Kind* found = find<Kind>();
    if (!found) throw input_error("watchers", "a simulation without this watcher", "one that has it");
    return *found;
  }
  /// `get<Kind>().figures()`; empty where the simulation has no such watcher.
  template <class Kind>
  auto figures() const {
    const Kind* found = find<Kind>();
    return found ? found->figures() : decltype(found->figures())();
  }
  /// Of RunHash. @throws Error (input) without it.
  std::uint64_t state_hash() const;
  /// Figures of all watchers beside the scene's criteria.
  std::vector<Verdict> verdicts() const;
  /// Of all watchers, one sentence each.
  std::vector<std::string> warnings() const;

  /// The run, watchers included. Costs some microseconds, the first one of a simulation some milliseconds.
  /// @throws Error (physics) of a simulation that has failed.
  RunSnapshot snapshot() const;
  /// Goes on from a snapshot of the same scene, to the bit as if the run had never stopped. Wall times in the
  /// ledger are those of both.
  /// @throws Error (input) naming what differs where the snapshot is of another scene, settings or engine,
  ///         where it lacks one of the watchers or does not hold together; the simulation then stands where
  ///         it stood. Error (physics) of a simulation that has failed.
  void restore(const RunSnapshot& snapshot);

  /// The motion without the watchers: cheaper. @throws Error (physics) of a simulation that has failed.
  MotionSnapshot motion() const;
  /// Goes on from a motion, to the bit; watchers begin anew.
  /// @throws Error (input) for a motion of a scene that was compiled apart from this one. Error (physics) of
  ///         a simulation that has failed.
  void reset(const MotionSnapshot& motion);
  /// Goes on from a state, at the step that is next to its time; controller and watchers begin anew.
  /// @throws Error (input) as Engine::set_state. Error (physics) of a simulation that has failed.
  void reset(const model::State& state);
  /// Takes over masses, inertias, gravity and materials of the scene's model, and gains of its control, that
  /// its owner has changed; the controller begins anew.
  /// @throws as Engine::refresh
  void refresh();

 private:
  struct LazyFingerprint;
  void advance(const engine::StepInput& action);
  void make_controller();
  void check(const engine::StepInput& action) const;
  engine::StepInput command(const engine::StepInput& action);
  void find_constant_torques();
  void make_watchers();
  void restore_parts(const RunSnapshot& snapshot);
  const std::shared_ptr<const Fingerprint>& fingerprint() const;

  std::shared_ptr<const scene::Scene> scene_;
  std::unique_ptr<engine::Engine> engine_;
  std::unique_ptr<control::Controller> controller_;
  std::vector<ClimbLoad> climbs_;
  MakeWatchers maker_;
  Watchers watchers_;
  bool timed_ = false;  ///< a watcher uses times
  long steps_ = 0;
  std::optional<Error> failure_;  ///< of a watcher, or no memory; not of the engine
  std::shared_ptr<LazyFingerprint> fingerprint_;
  std::vector<double> constant_;      ///< constant torques of the joints; empty where there are none
  std::vector<double> sum_;           ///< with those of the controller, climbs and caller
  std::vector<model::Servo> servos_;  ///< of the controller, climbs and caller
};

}  // namespace handsim::simulation
