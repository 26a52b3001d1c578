// Mass, centre and inertia of uniform solids and of rigid bodies put together from them.
#pragma once

#include <vector>

#include "handsim/model/model.h"

namespace handsim::scene {

/// Of a rigid body, in some frame.
struct MassProperties {
  double mass = 0;              ///< [kg]
  Vec3 centre = Vec3::Zero();   ///< of mass [m]
  Mat3 inertia = Mat3::Zero();  ///< about the centre of mass, in the frame's axes [kg m^2]
};

/// [m^3]; a plane: 0.
double volume(const model::Shape& shape);

/// Of a uniform solid of this mass, in the frame in which `shape.pose` places it.
MassProperties solid_properties(const model::Shape& shape, double mass);

/// Parts joined rigidly, all in one frame; parallel axes (Steiner).
MassProperties joined(const std::vector<MassProperties>& parts);

}  // namespace handsim::scene
