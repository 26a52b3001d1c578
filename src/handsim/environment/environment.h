// A scene to reset, step with actions and observe, without building it anew; batch.h steps many at once.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "handsim/environment/observation.h"
#include "handsim/environment/variation.h"
#include "handsim/simulation/simulation.h"

namespace handsim::environment {

/// Options of an environment; all environments of a batch have the same.
struct Setup {
  std::vector<std::string> observe = {"q", "u"};  ///< names of observation.h
  std::vector<Randomised> randomise = {};         ///< drawn by reset(seed)
  simulation::MakeWatchers watchers = simulation::no_watchers;
};

/// The caller's action: torques and forces are added, angles and wrists replace targets; empty: no effect.
struct Action {
  std::span<const double> torques = {};  ///< [N m] or [N], one for each coordinate, positive along it.
  /// [rad], that the scene's controller holds: one for each of its axes (Controller::axes).
  std::span<const double> angles = {};
  /// X_WH of each driven wrist (Model::drives) at the end of the action; it moves there at constant velocity.
  std::span<const Pose> wrists = {};
  /// Velocity of each driven wrist, in place of `wrists`.
  std::span<const model::PoseRate> wrist_rates = {};
  /// Excitation of each muscle, 0 to 1, as Model::muscles; replaces the scene's.
  std::span<const double> excitations = {};
  std::span<const engine::BodyForce> forces = {};  ///< Forces on bodies; engines ode and articulated.
};

/// A start that replaces the scene's own.
struct Start {
  std::span<const double> q = {};      ///< size dof_count(), or empty: the scene's
  std::span<const double> u = {};      ///< the same, or empty: at rest beside a q, else the scene's
  std::span<const Pose> objects = {};  ///< X_WB of each object that can move, or empty: the scene's
};

/// Can be moved. One thread at a time; different environments are independent.
class Environment {
 public:
  /// @throws Error (input) where the scene does not run, or the setup names what there is not.
  Environment(const scene::Scene& scene, Setup setup = {});
  /// Steps a scene that nobody else may use then. Its snapshots fit runs, too.
  Environment(std::shared_ptr<scene::Scene> scene, Setup setup);

  /// To the start of the scene, with the numbers that were set last.
  void reset();
  /// Draws the numbers of Setup::randomise, a function of the seed alone, then resets as reset() does.
  void reset(std::uint64_t seed);
  /// To a motion, to the bit; numbers that were set stay. @throws Error (input) for one of another scene.
  void reset(const simulation::MotionSnapshot& moment);
  /// @throws Error (input) for another number of coordinates or objects.
  void reset(const Start& start);
  /// Goes on from a state of this scene, at its time: Simulation::reset.
  void resume(const model::State& state) {
    begin();
    simulation_->reset(state);
  }
  /// To the coordinates, rates, activations and time of a state of a scene whose numbers may be others;
  /// bodies without a joint go where they are there. @throws Error (input) for one with other bodies or
  /// coordinates
  void reset_beside(const model::State& other);
  /// Continues a run: Simulation::restore.
  void restore(const simulation::RunSnapshot& snapshot);

  /// @param substeps steps of the scene's solver. @param after is called after each; what it throws ends this
  /// @throws Error (input) for an action of another size or not finite: nothing has moved then. Error
  /// (physics) where the motion diverges: `failure` then says so; every step throws it until the next reset.
  void step(const Action& action = {}, int substeps = 1, const std::function<void()>& after = {});
  /// Why the environment needs a reset; null where it does not.
  const Error* failure() const { return failure_ ? &*failure_ : nullptr; }

  /// Valid until the next call.
  std::span<const double> observe();
  const Observation& observation() const { return *observation_; }
  simulation::MotionSnapshot motion() const { return simulation_->motion(); }

  /// Changes a number of the scene (variation.h) from the next reset on.
  void set(std::string_view name, std::span<const double> values);
  std::vector<double> get(std::string_view name) const { return variation_->get(name); }

  const simulation::Simulation& simulation() const { return *simulation_; }
  const scene::Scene& scene() const { return *scene_; }
  /// Steps of the solver since the last reset.
  long steps() const { return steps_; }

 private:
  friend class Batch;
  /// @param shared others have the scene: copied before it changes. @param like one of them, or null
  Environment(std::shared_ptr<scene::Scene> scene, Setup setup, bool shared, const Environment* like);
  static std::shared_ptr<scene::Scene> lean(const scene::Scene& scene);
  void own_scene();
  void check_acts(std::string_view name) const;
  void begin();
  void build();
  void check(const Action& action, int substeps) const;
  std::span<const Pose> wrist_targets(const Action& action, int step, int substeps);

  std::shared_ptr<scene::Scene> scene_;         ///< numbers in it change
  std::shared_ptr<scene::Scene> shared_scene_;  ///< that of a batch, as long as it is the environment's
  Setup setup_;
  std::unique_ptr<Variation> variation_;
  std::shared_ptr<const Observation> observation_;  ///< of all that share the scene
  std::unique_ptr<simulation::Simulation> simulation_;
  std::shared_ptr<const simulation::MotionSnapshot> start_;  ///< that of a batch, while the scene is
  model::State state_;                                       ///< the scene's start
  std::optional<Error> failure_;
  std::vector<double> observed_;
  std::vector<Pose> from_, targets_;  ///< of the driven wrists
  long steps_ = 0;
  bool shared_ = false;  ///< scene_ is not the environment's own
  bool copied_ = false;  ///< the simulation has the shared scene still
};

}  // namespace handsim::environment
