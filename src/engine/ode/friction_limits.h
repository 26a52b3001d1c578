// Friction by the direct solver, whose rows have fixed limits. ODE's own limits come from the normal forces
// of a step without friction: fingers that friction holds press elsewhere without it, and a box that tips on
// the edge of its support had friction at points that carried nothing. Here a contact's limits are the
// friction coefficient times its normal force of the last step, and its first row lies along the force to
// come, so that the cone is circular where a row is at its limit. A step whose normal forces moved is made
// again with its own (fixed-point iteration on Tresca's friction: Panagiotopoulos 1975).
//
// Each row with limits costs the direct solver about as much as all rows without. So pads whose friction is
// far below its limit have none in the first solutions, and a solution in which they pass it is made again.
#pragma once

#include <optional>
#include <vector>

#include "handsim/core/archive.h"
#include "handsim/engine/contact/collider.h"

namespace handsim::engine::ode {

/// Friction may be off by this share of the largest friction limit of the step. Chosen.
inline constexpr double kFrictionError = 1e-3;

/// The force on a point of two shapes.
struct PointForce {
  int shape_a = 0, shape_b = 0;
  int index = 0;              ///< among the pair's points
  Vec3 force = Vec3::Zero();  ///< on a's body, world [N]
};

class FrictionLimits {
 public:
  /// Recalls the forces of the last step for the contacts just found.
  void recall(const Collider& collider);
  /// Force by which the limits of a contact are set; nothing for one that is new.
  const std::optional<Vec3>& force(std::size_t contact) const { return limits_[contact]; }
  /// @param relaxed whether sticking pads have no limits in the next solution
  void relax(bool relaxed) { relaxed_ = relaxed; }
  /// True if the contact's friction rows have no limits in this solution.
  bool unlimited(std::size_t index, const Contact& contact, const model::Material& surface) const;
  /// Takes in the forces of the contacts in the step just made, on a's bodies.
  /// @return true where friction is off by more than kFrictionError: the next limits are of these forces
  bool take_in(const Collider& collider, const std::vector<Vec3>& forces);

  const std::vector<PointForce>& last() const { return last_; }
  void set(const std::vector<PointForce>& last) { last_ = last; }
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);

 private:
  std::vector<PointForce> last_;             ///< in the collider's order
  std::vector<std::optional<Vec3>> limits_;  ///< as the contacts
  bool relaxed_ = false;
};

}  // namespace handsim::engine::ode
