// What every engine offers: a Model and its start in, one step at a time out. Engines own their own
// representation (ODE ids, reduced coordinates) and hand out poses and velocities as a State.
#pragma once

#include <array>
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

/// Faster than this and a body counts as run away.
inline constexpr double kMaxSpeed = 1e3;         ///< [m/s]
inline constexpr double kMaxAngularSpeed = 1e5;  ///< [rad/s]

/// What acts on the model during one step.
struct StepInput {
  /// Joint torques [N m] or forces [N], size model.dof_count() or empty, positive along the coordinate.
  std::span<const double> torques = {};
  /// Spring-damper drives solved within the step, size model.dof_count() or empty; they need the actuation
  /// effect. Only hinge, universal and slider coordinates can be driven.
  std::span<const model::Servo> servos = {};
};

/// How a guarded step was got through: the first way that kept to the limits.
enum class Rung {
  none,        ///< as set
  softer,      ///< with 100 x the CFM
  half_steps,  ///< as two steps of half the length
  quick_step,  ///< with quick_step at 200 iterations
  unresolved,  ///< none did; the last, which stays within an engine's bounds, was kept
};
inline constexpr std::array<std::string_view, 5> kRungNames = {"none", "softer", "half_steps", "quick_step",
                                                               "unresolved"};

/// A largest value and the index of where it was met.
struct ResidualPeak {
  double value = 0;
  int where = 0;
};

/// Velocities that a step's solver should have brought to nothing.
struct Residual {
  ResidualPeak linear;   ///< of joints [m/s]
  ResidualPeak angular;  ///< of joints [rad/s]
  ResidualPeak contact;  ///< with which rigid surfaces that touch come closer; by shape [m/s]
};

/// Steps of quick_step's that nothing new meets, from one whose residual is measured to the next: it changes
/// slowly there, and to measure it at each would be a twentieth of their cost.
inline constexpr long long kResidualEvery = 8;

/// What one step did.
struct StepReport {
  int lcp_failures = 0;    ///< times the direct solver gave up, in what was kept of the step
  Rung rung = Rung::none;  ///< of a guarded step
  int passes = 1;  ///< world_step: times that what was kept of the step was solved, see friction_passes
  bool iterative = false;  ///< solved by quick_step, or a heap of the articulated engine by relaxation
  /// Of steps in which the direct solver gave up, of those solved by iteration with contact or with another
  /// number of stops in force than before, and of every kResidualEvery-th of those without.
  std::optional<Residual> residual;
  int contacts = 0;             ///< contact points
  int stop_rows = 0;            ///< joint stops in force
  int collide_calls = 0;        ///< pairs given to the narrow phase
  int contact_sweeps = 0;       ///< articulated: of the contact solver
  int limit_updates = 0;        ///< articulated: of friction's limits, where Newton's method did not converge
  double contact_residual = 0;  ///< articulated: velocity that contacts and stops may be off by [m/s, rad/s]
  double collide_ns = 0;        ///< time in collision detection [ns]
  double tissue_ns = 0;         ///< time in setting passive tissue [ns]
  double servo_ns = 0;          ///< time in setting servos and torques [ns]
};

/// A contact point of the last step.
struct Contact {
  int shape_a = 0;
  int shape_b = 0;
  Vec3 position = Vec3::Zero();  ///< world [m]
  Vec3 normal = Vec3::Zero();    ///< world, unit, out of b into a
  double depth = 0;              ///< penetration; less the gap where the two are about to touch [m]
  /// On a's body, normal part and friction, over the step; world [N]. Zero unless settings.contact_forces.
  Vec3 force = Vec3::Zero();

  double normal_force() const { return force.dot(normal); }
  Vec3 friction_force() const { return force - normal_force() * normal; }
};

class Engine {
 public:
  virtual ~Engine() = default;

  /// Advances by settings().step.
  /// @throws Error (physics) naming time, body or joint and quantity when the state leaves its bounds or a
  ///         torque or servo is not finite; every later step throws the same error, state() stays the last
  ///         good one, other engines are not affected. Error (input) for a wrong number of torques or servos,
  ///         servos without actuation, negative gains or limits.
  virtual StepReport step(const StepInput& input) = 0;

  virtual const model::State& state() const = 0;
  /// Replaces poses, velocities and time. Kinematic bodies may be put elsewhere; those that no drive moves
  /// stay there, at rest. @throws Error (input) for a state of another model or with non-finite numbers.
  virtual void set_state(const model::State& state) = 0;
  /// What the steps to come depend on beyond state(), so that `restore` goes on to the bit. Nothing where an
  /// engine says nothing. @throws Error (physics) of an engine that has failed.
  virtual void save(ArchiveWriter& out) const;
  /// Takes over a state() and what `save` wrote with it, in an engine of the same model and settings.
  /// @throws Error (input) for a state of another model or an archive that does not fit; the engine then
  ///         stands anywhere, and goes on only from another state. Error (physics) of an engine that has
  ///         failed.
  virtual void restore(const model::State& state, ArchiveReader& in);
  virtual std::span<const Contact> contacts() const = 0;
  virtual const Settings& settings() const = 0;
  /// True where a collision space exists.
  virtual bool tests_contacts() const = 0;
  /// Name, version and build of the engine, e.g. `ODE 0.16.2 double`.
  virtual std::string version() const = 0;
  /// Where the engine departs from the model, one sentence each, e.g. a stop that it moved.
  virtual std::vector<std::string> notes() const = 0;
};

/// Builds the engine that the settings are of and puts it at model::initial_state(model).
/// @throws Error (input) naming every invalid part of the model or setting.
/// The model must outlive the engine.
std::unique_ptr<Engine> make_engine(const model::Model& model, const Settings& settings);
/// A model that ends before its engine.
std::unique_ptr<Engine> make_engine(const model::Model&& model, const Settings& settings) = delete;

}  // namespace handsim::engine
