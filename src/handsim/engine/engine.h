// The interface of all engines: an engine is built from a Model and advances it one step at a time. It keeps
// a representation of its own (ODE ids, joint coordinates) and returns poses and velocities as a State.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/core/archive.h"
#include "handsim/core/error.h"
#include "handsim/engine/settings.h"
#include "handsim/model/actuation.h"
#include "handsim/model/state.h"

namespace handsim::engine {

/// A step that makes a body faster than this fails.
inline constexpr double kMaxSpeed = 1e3;         ///< [m/s]
inline constexpr double kMaxAngularSpeed = 1e5;  ///< [rad/s]

/// External force and moment on one body during one step.
struct BodyForce {
  int body = 0;                ///< in Model::bodies, one that can move
  Vec3 force = Vec3::Zero();   ///< at its centre of mass, world axes [N]
  Vec3 moment = Vec3::Zero();  ///< world axes [N m]
};

/// Torques, servos, external forces and targets of driven bodies during one step.
struct StepInput {
  /// Joint torques [N m] or forces [N], size model.dof_count() or empty, positive along the coordinate.
  std::span<const double> torques = {};
  /// Spring-damper drives that the step solves implicitly, size model.dof_count() or empty; they need the
  /// actuation effect. Only hinge, universal and slider coordinates can be driven.
  std::span<const model::Servo> servos = {};
  /// Forces from outside; several on one body add. Engines ode and articulated with semi_implicit_euler.
  std::span<const BodyForce> forces = {};
  /// X_WD at the end of the step for each of Model::drives, in place of their motions, or empty. The bodies
  /// move there at constant velocity. Engines ode and articulated with semi_implicit_euler.
  std::span<const Pose> drive_targets = {};
  /// Excitations of the muscles, 0..1, as Model::muscles; empty: none. They need the muscles effect.
  std::span<const double> excitations = {};
};

/// A largest value and the index of its joint or shape.
struct ResidualPeak {
  double value = 0;
  int where = 0;
};

/// Velocities that violate the constraints after a step; an exact solution has none.
struct Residual {
  ResidualPeak linear;   ///< of joints [m/s]
  ResidualPeak angular;  ///< of joints [rad/s]
  ResidualPeak contact;  ///< approach of rigid surfaces in contact; `where` is a shape [m/s]
};

/// Without contacts and new stops, the residual of quick_step is measured every 8th step: it changes slowly,
/// and measuring it in every step would take about 5 % of the CPU time.
inline constexpr long long kResidualInterval = 8;

/// Figures of one step.
struct StepReport {
  int lcp_failures = 0;    ///< failures of the direct solver
  int passes = 1;          ///< world_step: solutions of the step that was kept (OdeSettings::friction_passes)
  bool iterative = false;  ///< true if quick_step, or relaxation of the articulated engine, solved the step
  /// Measured in steps in which the direct solver failed, in steps of quick_step with contacts or a changed
  /// number of active stops, and in every kResidualInterval-th other step of quick_step.
  std::optional<Residual> residual;
  int contacts = 0;             ///< contact points
  int stop_rows = 0;            ///< active joint stops
  int collide_calls = 0;        ///< pairs of shapes tested by the narrow phase
  int contact_sweeps = 0;       ///< articulated: iterations of the contact solver
  int limit_updates = 0;        ///< articulated: updates of friction limits after Newton's method failed
  double contact_residual = 0;  ///< articulated: error bound of velocities at contacts and stops [m/s, rad/s]
  double collide_ns = 0;        ///< time of collision detection [ns]
  double tissue_ns = 0;         ///< time to set passive tissue [ns]
  double servo_ns = 0;          ///< time to set servos and torques [ns]
};

/// A contact point of the last step.
struct Contact {
  int shape_a = 0;
  int shape_b = 0;
  Vec3 position = Vec3::Zero();  ///< world [m]
  Vec3 normal = Vec3::Zero();    ///< world, unit, from b to a
  double depth = 0;              ///< penetration [m]; negative: the gap of a speculative contact
  /// Mean force on a's body over the step, normal and friction; world [N]. 0 without settings.contact_forces.
  Vec3 force = Vec3::Zero();

  double normal_force() const { return force.dot(normal); }
  Vec3 friction_force() const { return force - normal_force() * normal; }
};

class Engine {
 public:
  virtual ~Engine() = default;

  /// Advances by settings().step. All input is checked before anything moves: a refused step leaves no trace.
  /// @throws Error (physics) with time, body or joint, and quantity if the new state is out of bounds or a
  ///         torque or servo is not finite. Then every later step throws the same error, state() keeps the
  ///         last valid state, and other engines are not affected. Error (input) for a wrong number of
  ///         torques or servos, servos without the actuation effect, negative gains or limits, and forces or
  ///         drive targets that are not sound or that the engine does not take.
  virtual StepReport step(const StepInput& input) = 0;

  virtual const model::State& state() const = 0;
  /// Replaces poses, velocities and time. Kinematic bodies can be moved; those without a drive then rest at
  /// their new place. @throws Error (input) for a state of another model or numbers that are not finite.
  virtual void set_state(const model::State& state) = 0;
  /// Writes the internal state on which the next steps depend, beside state(), so that a run after `restore`
  /// has the same bits. The default writes nothing. @throws Error (physics) if the engine has failed.
  virtual void save(ArchiveWriter& out) const;
  /// Restores a state() and what `save` wrote with it, for the same model and settings. @throws Error (input)
  /// for another model's state or archive (restore or set_state is then due), Error (physics) after a failure
  virtual void restore(const model::State& state, ArchiveReader& in);
  /// Reads changed masses, inertias (same principal axes), gravity and materials of the model. @throws
  /// Error (input) by engine dae; Error (physics) of an engine that has failed
  virtual void refresh();
  virtual std::span<const Contact> contacts() const = 0;
  virtual const Settings& settings() const = 0;
  /// True if the engine tests shapes for contact.
  virtual bool tests_contacts() const = 0;
  /// Name, version and build of the engine, e.g. `ODE 0.16.2 double`.
  virtual std::string version() const = 0;
  /// Differences between the engine and the model, one sentence each, e.g. a stop that the engine moved.
  virtual std::vector<std::string> notes() const = 0;
};

/// The engine of the settings, in model::initial_state(model). The model must outlive it. @throws Error
/// (input) with every invalid part of the model and the settings
std::unique_ptr<Engine> make_engine(const model::Model& model, const Settings& settings);
/// Rejects a temporary model, which would end before its engine.
std::unique_ptr<Engine> make_engine(const model::Model&& model, const Settings& settings) = delete;

}  // namespace handsim::engine
