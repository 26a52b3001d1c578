// The set of wrenches that contacts can put on an object, and how good a grasp that makes (Ferrari & Canny
// 1992, ICRA, pp. 2290-2295). Each contact's friction cone is replaced by a pyramid inside it; the normal
// forces of all contacts sum to at most 1 (their L1 norm), so the wrench space is the convex hull of the
// pyramids' edges, found by Qhull. Torques are about the object's centre of mass, divided by a length.
#pragma once

#include <span>

#include "handsim/core/pose.h"

namespace handsim::simulation {

/// Edges of the pyramid that stands for a friction cone.
inline constexpr int kConeEdges = 8;

/// What the wrench space needs of a contact.
struct WrenchContact {
  Vec3 position = Vec3::Zero();  ///< relative to the object's centre of mass [m]
  Vec3 normal = Vec3::UnitZ();   ///< unit, into the object
  double friction = 0;           ///< Coulomb coefficient
  double spinning = 0;           ///< largest moment about the normal per normal force [m]; 0: a hard point
};

struct WrenchSpace {
  /// The origin lies inside: the contacts can resist any small wrench.
  bool force_closure = false;
  /// Radius of the largest ball about the origin within the hull: the smallest wrench (forces in shares of
  /// the sum of normal forces, torques over the length) that breaks the grasp; 0 without force closure.
  double epsilon = 0;
  double volume = 0;  ///< of the hull in its six dimensions; 0 where it is flat
};

/// @param length that torques are divided by [m], > 0: commonly the object's largest radius.
/// Where even Qhull's joggled input gives no hull, none is claimed: no force closure.
WrenchSpace wrench_space(std::span<const WrenchContact> contacts, double length);

}  // namespace handsim::simulation
