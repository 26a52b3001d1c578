// What is left of a segment's capsule when the space that it shares with its neighbours counts once.
#pragma once

#include "handsim/model/model.h"

namespace handsim::hand {

/// Planes across the axis of a capsule that starts at its segment's joint.
struct Cut {
  double begins = 0;      ///< of the near plane, from the joint [m]
  bool flat_end = false;  ///< the far plane is at the end of the axis; else half a ball follows
};

/// A cylinder, and half a ball if the end is not flat.
struct CapsuleMatter {
  double volume = 0;      ///< [m^3]
  double centre = 0;      ///< along the axis from the joint [m]
  double transverse = 0;  ///< moment about the centre per mass [m^2]
  double axial = 0;       ///< the same about the axis [m^2]
};
CapsuleMatter matter(const model::Shape& capsule, const Cut& cut);

/// The capsule shares with its parent what lies in a ball about the joint.
/// @param reach radius of the ball [m]
/// @returns the length of the capsule's own cylinder that has this volume [m]
double covered(double reach, double radius);

/// A parent's half ball at the joint sticks out of its child's cylinder.
/// @returns the length of the child's cylinder that has the volume of what sticks out [m]
double bulge(double parent_radius, double radius);

}  // namespace handsim::hand
