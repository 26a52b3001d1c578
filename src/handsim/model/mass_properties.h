// Mass, centre and inertia of uniform solids and of rigid bodies composed of them.
#pragma once

#include <vector>

#include "handsim/model/model.h"

namespace handsim::model {

/// Mass properties of a rigid body in a given frame.
struct MassProperties {
  double mass = 0;              ///< [kg]
  Vec3 centre = Vec3::Zero();   ///< of mass [m]
  Mat3 inertia = Mat3::Zero();  ///< about the centre of mass, in the frame's axes [kg m^2]
};

/// Principal moments of a solid box about its centre, per mass, times 12 [m^2].
Vec3 box_moments(const Vec3& edges);

/// Volume and moments of a solid capsule along z.
struct CapsuleInertia {
  double volume = 0;                 ///< [m^3]
  double axial = 0, transverse = 0;  ///< about its centre, per mass [m^2]
};
/// @param length between the centres of the half spheres [m].
CapsuleInertia capsule_inertia(double radius, double length);

/// Volume [m^3]; 0 for a plane.
double volume(const Shape& shape);

/// Mass properties of a uniform solid of this mass, in the frame that `shape.pose` refers to.
MassProperties solid_properties(const Shape& shape, double mass);

/// Mass properties of rigidly joined parts, all in one frame (parallel axis theorem).
MassProperties joined(const std::vector<MassProperties>& parts);

}  // namespace handsim::model
