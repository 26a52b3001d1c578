// Mass, centre and inertia of uniform solids and of rigid bodies put together from them.
#pragma once

#include <vector>

#include "handsim/model/model.h"

namespace handsim::model {

/// Of a rigid body, in some frame.
struct MassProperties {
  double mass = 0;              ///< [kg]
  Vec3 centre = Vec3::Zero();   ///< of mass [m]
  Mat3 inertia = Mat3::Zero();  ///< about the centre of mass, in the frame's axes [kg m^2]
};

/// Of a solid box: twelve times its principal moments about its centre, per mass [m^2].
Vec3 box_moments(const Vec3& edges);

/// Mass and moments of a solid capsule along z.
struct CapsuleInertia {
  double volume = 0;                 ///< [m^3]
  double axial = 0, transverse = 0;  ///< about its centre, per mass [m^2]
};
/// @param length between the centres of the half spheres [m].
CapsuleInertia capsule_inertia(double radius, double length);

/// [m^3]; a plane: 0.
double volume(const Shape& shape);

/// Of a uniform solid of this mass, in the frame in which `shape.pose` places it.
MassProperties solid_properties(const Shape& shape, double mass);

/// Parts joined rigidly, all in one frame; parallel axes (Steiner).
MassProperties joined(const std::vector<MassProperties>& parts);

}  // namespace handsim::model
