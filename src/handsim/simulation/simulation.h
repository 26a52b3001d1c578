// The simulation loop of a scene: command, step, watchers of each step. Files and pictures: run/run.h.
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

/// @throws Error (input) with all objects that start inside a hand, because contact would accelerate them.
void check_start(const scene::Scene& scene);

/// Places a state's joints at coordinates and rates of size dof_count(). @throws Error (input) with all that
/// are not finite, beyond half a turn, or more than kBeyondStop beyond stops in effect
void place_start(const scene::Scene& scene, std::span<const double> q, std::span<const double> u,
                 model::State& state);
inline constexpr double kBeyondStop = 0.05;         ///< of an angle [rad]
inline constexpr double kSliderBeyondStop = 0.005;  ///< [m]

/// Movable. Several threads may call const methods at the same time.
class Simulation {
 public:
  /// Shares the scene. @param watchers makes the watchers: standard_watchers, no_watchers (as fast as the
  /// engine), `only<Monitor, RunHash>` or a function of the caller. @throws Error (input) if the engine
  /// refuses the model, or for an object over 1 mm inside a hand it can touch without `overlap: allowed`
  explicit Simulation(std::shared_ptr<const scene::Scene> scene, MakeWatchers watchers = standard_watchers);
  /// Simulates a scene that the simulation then owns.
  explicit Simulation(scene::Scene scene, MakeWatchers watchers = standard_watchers)
      : Simulation(std::make_shared<const scene::Scene>(std::move(scene)), std::move(watchers)) {}

  /// One step of the scene's solver: command, step, sense, watch.
  /// @param action the caller's action in this step: torques [N m] or forces [N], which are added to those of
  ///         the scene, and servos, which replace those of the scene on coordinates where their limit is
  ///         above 0. Each of size model().dof_count() or empty, in the order of the coordinates
  ///         (Joint::first_dof), positive along the coordinate. Servos need the actuation effect
  ///         (spec.solver.effects). Forces on bodies, and targets of driven bodies in place of their motions.
  /// @param angles [rad] that the controller is to hold at the step's end, one for each of its axes; empty:
  ///        those of the scene's poses
  /// @throws Error (input) for an action of another size, with numbers that are not finite or out of range,
  ///         or for servos without actuation; the state is then unchanged. Error (physics) with time, body or
  ///         joint and quantity if the state is out of bounds, and in every later step until a reset.
  void step(const engine::StepInput& action = {}, std::span<const double> angles = {});

  const scene::Scene& scene() const { return *scene_; }
  const model::Model& model() const { return scene_->model; }
  const model::State& state() const { return engine_->state(); }
  const engine::Engine& engine() const { return *engine_; }
  /// Report of the last step; empty before the first one and after a reset or restore.
  const engine::StepReport& last_report() const { return report_; }
  /// Null if the scene has no control.
  const control::Controller* controller() const { return controller_.get(); }
  /// Excitations of the muscles in the last step, as Model::muscles; empty if nothing gave any.
  std::span<const double> excitations() const { return excitations_; }
  /// Number of steps since the start of the scene, including those before a snapshot.
  long steps() const { return steps_; }
  /// Number of steps of the scene's duration.
  long step_count() const;

  const Watchers& watchers() const { return watchers_; }
  /// A watcher; null if the simulation has none of this type. The pointer is valid until a reset.
  template <class Kind>
  const Kind* find() const {
    for (const auto& watcher : watchers_)
      if (const auto* found = dynamic_cast<const Kind*>(watcher.get())) return found;
    return nullptr;
  }
  /// @throws Error (input) if the simulation has no such watcher.
  template <class Kind>
  const Kind& get() const {
    const Kind* found = find<Kind>();
    if (!found) throw input_error("watchers", "a simulation without this watcher", "one that has it");
    return *found;
  }
  /// `get<Kind>().figures()`; empty if the simulation has no such watcher.
  template <class Kind>
  auto figures() const {
    const Kind* found = find<Kind>();
    return found ? found->figures() : decltype(found->figures())();
  }
  /// Value of the watcher RunHash. @throws Error (input) without this watcher.
  std::uint64_t state_hash() const;
  /// Figures of all watchers, with the limits of the scene's criteria.
  std::vector<Verdict> verdicts() const;
  /// Warnings of all watchers, one sentence each.
  std::vector<std::string> warnings() const;

  /// The run with its watchers. Takes some microseconds, the first one of a simulation some milliseconds.
  /// @throws Error (physics) if the simulation has failed.
  RunSnapshot snapshot() const;
  /// Continues from a snapshot of the same scene, with the same bits as an uninterrupted run, also after a
  /// failure. The ledger has the sum of both wall times.
  /// @throws Error (input) with the difference if the snapshot has another scene, settings or engine, lacks a
  ///         watcher, or is damaged; the simulation is then unchanged, a failed one maybe at its start.
  void restore(const RunSnapshot& snapshot);

  /// The motion without the watchers, which is faster. @throws Error (physics) if the simulation has failed.
  MotionSnapshot motion() const;
  /// To the start of the scene, with the bits of a new simulation. Resets work after a failure, too.
  void reset();
  /// Continues a motion to the bit, with new watchers. @throws Error (input) for a scene compiled apart
  void reset(const MotionSnapshot& motion);
  /// Goes on from a state, at the step that is next to its time; controller and watchers begin anew.
  /// @throws Error (input) as Engine::set_state.
  void reset(const model::State& state);
  /// Reads changed masses, inertias, gravity and materials of the scene's model, and gains of its
  /// control; the controller begins anew. @throws as Engine::refresh
  void refresh();

 private:
  struct LazyFingerprint;
  template <class Work>
  void keep_failure(const Work& work);
  void revive();
  void advance(const engine::StepInput& action);
  void make_controller();
  void save_motion(ArchiveWriter& out) const;
  void restore_motion(const model::State& state, ArchiveReader& in);
  void check(const engine::StepInput& action) const;
  engine::StepInput command(const engine::StepInput& action);
  engine::StepInput excite(engine::StepInput input, const engine::StepInput& action);
  void compute_constant_torques();
  void make_watchers();
  void restore_parts(const RunSnapshot& snapshot);
  const std::shared_ptr<const Fingerprint>& fingerprint() const;

  std::shared_ptr<const scene::Scene> scene_;
  std::unique_ptr<engine::Engine> engine_;
  std::unique_ptr<control::Controller> controller_;
  std::unique_ptr<control::MuscleDrive> drive_;  ///< of muscles, by the scene
  std::vector<ClimbLoad> climbs_;
  MakeWatchers maker_;
  Watchers watchers_;
  engine::StepReport report_;
  bool timed_ = false;  ///< a watcher uses times
  long steps_ = 0;
  std::optional<Error> failure_;  ///< of the engine, of a watcher, or lack of memory
  std::shared_ptr<LazyFingerprint> fingerprint_;
  std::vector<double> constant_;      ///< constant torques of the joints; empty if there are none
  std::vector<double> sum_;           ///< the same plus those of the controller, climbs and caller
  std::vector<model::Servo> servos_;  ///< of the controller, climbs and caller
  std::vector<double> excitations_;
};

}  // namespace handsim::simulation
