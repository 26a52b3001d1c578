// The set of wrenches that contacts can apply to an object, and the grasp quality from it (Ferrari & Canny
// 1992, ICRA, pp. 2290-2295). Each contact's friction cone is replaced by a pyramid inside it; the normal
// forces of all contacts sum to at most 1 (their L1 norm), so the wrench space is the convex hull of the
// pyramids' edges, found by Qhull. Torques are about the object's centre of mass, divided by a length.
#pragma once

#include <span>

#include "handsim/core/pose.h"

namespace handsim::simulation {

inline constexpr int kConeEdges = 8;  ///< Number of edges of the pyramid that replaces a friction cone.

struct WrenchContact {
  Vec3 position = Vec3::Zero();  ///< relative to the object's centre of mass [m]
  Vec3 normal = Vec3::UnitZ();   ///< unit, into the object
  double friction = 0;           ///< Coulomb coefficient
  double spinning = 0;  ///< largest moment about the normal per normal force [m]; 0: a hard point contact
};

struct WrenchSpace {
  bool force_closure = false;  ///< True if the origin is inside: the contacts can resist any small wrench.
  /// Radius of the largest ball about the origin within the hull: the smallest wrench that the contacts
  /// cannot resist (forces over the sum of normal forces, torques over the length); 0 without force closure.
  double epsilon = 0;
  double volume = 0;  ///< of the hull in six dimensions; 0 if it is flat
};

/// @param length length by which torques are divided [m], > 0: commonly the object's largest radius.
/// If Qhull finds no hull even with joggled input, the result has no force closure.
WrenchSpace wrench_space(std::span<const WrenchContact> contacts, double length);

}  // namespace handsim::simulation
