// Friction that holds a position, not only a speed. An iterative solver leaves a residual and so lets
// surfaces that stick creep in every step; here each pair of touching shapes remembers how far it has crept,
// and its friction rows ask for the speed that takes half of that back in a step. The displacement is
// integrated from the slip velocity at the contact, so rolling leaves none (Cundall & Strack 1979,
// Geotechnique 29:47), and is bounded: surfaces that slide are at the limit of friction, whatever their rows
// ask for. One displacement for all points of a pair keeps redundant points consistent.
#pragma once

#include <optional>
#include <vector>

#include "handsim/core/archive.h"
#include "handsim/engine/collision/collider.h"
#include "handsim/engine/ode/bodies.h"

namespace handsim::engine::ode {

/// Longest displacement that is taken back [m], rigid and pads; skin shears by more. Shorter: holds with a
/// large residual creep. Longer: sliding bodies spring back farther when they stop.
inline constexpr double kLongestRigidShift = 2e-5, kLongestPadShift = 3e-4;
/// Share of it that friction rows take back in a step. Near 1: a residual's noise is fed back.
inline constexpr double kPullBack = 0.5;

/// The displacement of two touching shapes on each other that friction has not taken back yet.
struct Presliding {
  int shape_a = 0;
  int shape_b = 0;
  /// Displacement of a's surface against b's at the middle of the contact, in b's body frame [m].
  Vec3 shift = Vec3::Zero();
  double turn = 0;  ///< of a against b about the contact's normal [rad]
};

/// The points of one pair of shapes in one step.
struct Patch {
  std::size_t first = 0;  ///< of the pair's points in the list of contacts
  std::size_t count = 0;
  int body_a = 0, body_b = 0;
  Vec3 centre = Vec3::Zero();  ///< mean of the points, world [m]
  Vec3 normal = Vec3::Zero();  ///< unit, out of b into a, world
  double reach = 0;            ///< of the points from the centre, at least the spinning friction's lever [m]
  double longest = 0;          ///< displacement that is kept [m]
  Vec3 shift = Vec3::Zero();   ///< displacement of a against b at the centre, tangential, world [m]
  double turn = 0;             ///< about the normal [rad]

  /// Displacement at a point of the patch [m].
  Vec3 shift_at(const Vec3& point) const { return shift + turn * normal.cross(point - centre); }
};

class PreslidingMemory {
 public:
  /// Model and bodies must outlive this object.
  PreslidingMemory(const model::Model& model, const std::vector<OdeBody>& bodies)
      : model_(model), bodies_(bodies) {}

  /// Finds the displacements of the pairs that touch now. @param state at which the contacts were found
  void recall(const Collider& collider, const model::State& state);
  std::span<const Patch> patches() const { return patches_; }
  /// Adds the slip of the step just made to the displacements. @param before the step's start; @param step
  /// its length [s]
  void update(const model::State& before, double step);

  const std::vector<Presliding>& pairs() const { return pairs_; }
  void set(const std::vector<Presliding>& pairs) { pairs_ = pairs; }
  void save(ArchiveWriter& out) const;
  /// @throws Error (input) for shapes that the model has not.
  void restore(ArchiveReader& in);

 private:
  Vec3 velocity(int body, const Vec3& place, const model::State& before) const;
  Vec3 spin(int body) const;

  const model::Model& model_;
  const std::vector<OdeBody>& bodies_;
  std::vector<Patch> patches_;
  std::vector<Presliding> pairs_;  ///< in the collider's order of pairs
};

// Friction by the direct solver, whose rows have fixed limits. ODE's own limits come from the normal forces
// of a step without friction: fingers that friction holds press elsewhere without it, and a box that tips on
// the edge of its support had friction at points that carried nothing. Here a contact's limits are the
// friction coefficient times its normal force of the last step, and its first row lies along the force to
// come, so that the cone is circular where a row is at its limit. A step whose normal forces moved is made
// again with its own (fixed-point iteration on Tresca's friction: Panagiotopoulos 1975). Friction on a
// support that a box is wedged against moves the normal forces to and fro from solution to solution: where a
// second solution is no nearer, limits of rigid contacts change by a share only and become exact with time.

/// Friction may be off by this share of the largest friction limit of the step: of pads; of rigid surfaces,
/// whose normal forces of several points move far for little. Chosen.
inline constexpr double kFrictionError = 1e-3, kRigidFrictionError = 1e-2;

/// The force on a point of two shapes.
struct PointForce {
  int shape_a = 0, shape_b = 0;
  Vec3 position = Vec3::Zero();  ///< world [m]
  Vec3 force = Vec3::Zero();     ///< on a's body, world [N]
};

/// Slower sliding has no direction that outlasts rounding [m/s].
inline constexpr double kStill = 1e-9;

/// What friction of a pad is taken to do in one solution. ODE's direct solver takes each row with limits by
/// itself and factors all rows without limits at once.
enum class Guess : char {
  limited,  ///< nothing: the contact's rows have their limits
  sticks,   ///< it presses, and friction is below its limit: three rows without limits
  slides,   ///< it presses, and friction is at its limit
};

/// A contact that is guessed. Friction of one that slides is Coulomb's law along the slip, linear about a
/// slip: a force along it, and across it a row that gives way as the friction turns with the slip.
struct Guessed {
  Guess guess = Guess::limited;
  Vec3 along = Vec3::Zero();  ///< unit, world: direction in which a slides on b
  double speed = 0;           ///< of the slip, at which friction turns with it [m/s]
  double limit = 0;           ///< of friction [N]
  /// Velocity of a against b after the step, tangential, beyond what rows give way by, world [m/s].
  Vec3 slip = Vec3::Zero();
};

class FrictionLimits {
 public:
  /// Finds the forces of the last step at the contacts just found.
  void recall(const Collider& collider);
  /// Force by which the limits of a contact are set; nothing for one that is new.
  const std::optional<Vec3>& force(std::size_t contact) const { return limits_[contact]; }
  /// Changes each guess that the solution just made does not bear out: a pad that pulls, one that sticks with
  /// more than friction can hold, one whose friction is not that of its slip.
  /// @param forces of the contacts, on the bodies of shapes a [N]; @param mend false: such a contact gets its
  /// limits
  /// @return whether there was one
  bool refute(const Collider& collider, const std::vector<Vec3>& forces, std::vector<Guessed>& guesses,
              bool mend);
  /// Sets the next limits from the forces of the contacts in the step just made, on the bodies of shapes a.
  /// @return true where friction is off and another solution, with limits of these forces, may come nearer
  bool update(const Collider& collider, const std::vector<Vec3>& forces);

  /// The numbers that friction limits keep from step to step.
  struct Memory {
    std::vector<PointForce> points;  ///< in the collider's order
    double share = 1;                ///< of the change of the normal forces that the next limits take over
  };
  const Memory& memory() const { return memory_; }
  void set(const Memory& memory) { memory_ = memory; }
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);

 private:
  Memory memory_;
  std::vector<std::optional<Vec3>> limits_;  ///< as the contacts
  std::vector<double> normals_;              ///< the normal forces that the limits were of, as the contacts
  std::optional<double> error_;  ///< of the solution before, of what may be; nothing: it was the first
};

}  // namespace handsim::engine::ode
