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

}  // namespace handsim::scene
