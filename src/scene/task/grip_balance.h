// Forces of a hand on an object that keep it at rest: each finger presses with the force that is asked of it,
// and palm and other fingers with what balances these.
#pragma once

#include <optional>
#include <vector>

#include "handsim/core/pose.h"

namespace handsim::scene {

struct GripContact {
  Vec3 point = Vec3::Zero();   ///< [m]
  Vec3 normal = Vec3::Zero();  ///< unit, into the object
  double friction = 0;         ///< coefficient that may be used
  std::size_t presser = 0;     ///< the finger, in GripTask::asked
  double limit = friction;     ///< coefficient at which it slides
  double spinning = 0;         ///< largest moment about the normal over the normal force [m]
};

struct GripTask {
  std::vector<GripContact> contacts;
  std::vector<std::optional<double>> asked;  ///< sum of the normal forces of each presser [N]; absent: any
  Vec3 load = Vec3::Zero();                  ///< other force on the object, at `centre` [N]
  Vec3 centre = Vec3::Zero();                ///< [m]
  double size = 0.05;                        ///< of the object: a moment counts as a force at this arm [m]
};

struct GripForces {
  std::vector<Vec3> forces;  ///< on the object, of each contact [N]
  /// Force that is left over, with the moment over the size, as a share of the sum of normal forces.
  double unbalanced = 0;
};

/// Least squares with forces within their friction cones (of 8 edges): equilibrium first, then the forces
/// that are asked, then small forces.
GripForces balance(const GripTask& task);

/// The share that the worst of several loads at the centre takes of what the contacts hold besides `forces`.
/// Each contact holds an ellipsoid of forces: along the normal as much as it presses, along the surface the
/// friction that is left. Each carries at most this share of its own where the sum of squares is least; so
/// they hold up to the square root of their number more. @param loads [N]
double load_share(const GripTask& task, const GripForces& forces, const std::vector<Vec3>& loads);

}  // namespace handsim::scene
