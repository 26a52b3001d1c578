// Friction that holds a position, not only a speed. An iterative solver leaves a residual and so lets
// surfaces that stick creep in every step; here each pair of touching shapes remembers how far it has crept,
// and its friction rows ask for the speed that takes half of that back in a step. The displacement is
// integrated from the slip velocity at the contact, so rolling leaves none (Cundall & Strack 1979,
// Geotechnique 29:47), and is bounded: surfaces that slide are at the limit of friction, whatever their rows
// ask for. One displacement for all points of a pair keeps redundant points consistent.
#pragma once

#include <vector>

#include "handsim/core/archive.h"
#include "handsim/engine/collision/collider.h"
#include "handsim/engine/ode/bodies.h"

namespace handsim::engine::ode {

/// Longest displacement that is taken back [m], of rigid surfaces and of pads; skin shears by more before it
/// slides. Shorter: a hold that the solver leaves a large residual of creeps on. Longer: sliding bodies
/// spring back farther when they stop.
inline constexpr double kLongestRigidShift = 2e-5, kLongestPadShift = 3e-4;
/// Share of it that friction rows take back in a step. Near 1: a residual's noise is fed back.
inline constexpr double kPullBack = 0.5;

/// How far two touching shapes have slid on each other without being pulled back yet.
struct Presliding {
  int shape_a = 0;
  int shape_b = 0;
  /// Of a's surface against b's at the middle of the contact, in b's body frame [m].
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
  /// Model and bodies must outlive this.
  PreslidingMemory(const model::Model& model, const std::vector<OdeBody>& bodies)
      : model_(model), bodies_(bodies) {}

  /// Recalls what the touching pairs have crept. @param state at which they were found
  void recall(const Collider& collider, const model::State& state);
  std::span<const Patch> patches() const { return patches_; }
  /// Takes in the slip of the step just made. @param before its start; @param step its length [s]
  void take_in(const model::State& before, double step);

  const std::vector<Presliding>& pairs() const { return pairs_; }
  void set(const std::vector<Presliding>& pairs) { pairs_ = pairs; }
  void save(ArchiveWriter& out) const;
  /// @throws Error (input) for shapes that the model has not.
  void restore(ArchiveReader& in);

 private:
  Vec3 velocity(int body, const Vec3& at, const model::State& before) const;
  Vec3 spin(int body) const;

  const model::Model& model_;
  const std::vector<OdeBody>& bodies_;
  std::vector<Patch> patches_;
  std::vector<Presliding> pairs_;  ///< in the collider's order of pairs
};

}  // namespace handsim::engine::ode
