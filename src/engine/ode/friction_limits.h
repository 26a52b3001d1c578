// Friction by the direct solver, whose rows have fixed limits. ODE's own limits come from the normal forces
// of a step without friction: fingers that friction holds press elsewhere without it, and a box that tips on
// the edge of its support had friction at points that carried nothing. Here a contact's limits are the
// friction coefficient times its normal force of the last step, and its first row lies along the force to
// come, so that the cone is circular where a row is at its limit. A step whose normal forces moved is made
// again with its own (fixed-point iteration on Tresca's friction: Panagiotopoulos 1975). Friction on a
// support that a box is wedged against moves the normal forces to and fro from solution to solution: where a
// second solution comes no nearer, limits of rigid contacts take over a share of the change only, and become
// exact over some steps.
#pragma once

#include <optional>
#include <vector>

#include "handsim/core/archive.h"
#include "handsim/engine/collision/collider.h"

namespace handsim::engine::ode {

/// Friction may be off by this share of the largest friction limit of the step: of pads; of rigid surfaces,
/// whose normal forces of several points move far for little. Chosen.
inline constexpr double kFrictionError = 1e-3, kRigidFrictionError = 1e-2;

/// The force on a point of two shapes.
struct PointForce {
  int shape_a = 0, shape_b = 0;
  Vec3 position = Vec3::Zero();  ///< world [m]
  Vec3 force = Vec3::Zero();     ///< on a's body, world [N]
};

class FrictionLimits {
 public:
  /// Recalls the forces of the last step for the contacts just found.
  void recall(const Collider& collider);
  /// Force by which the limits of a contact are set; nothing for one that is new.
  const std::optional<Vec3>& force(std::size_t contact) const { return limits_[contact]; }
  /// Takes in the forces of the contacts in the step just made, on a's bodies.
  /// @return true where friction is off and another solution, with limits of these forces, may come nearer
  bool take_in(const Collider& collider, const std::vector<Vec3>& forces);

  /// What it keeps from step to step.
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
