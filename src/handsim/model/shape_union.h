// Volume, centre and inertia of shapes that overlap: space that several share counts once.
#pragma once

#include <vector>

#include "handsim/model/mass_properties.h"

namespace handsim::model {

/// Mass properties of the union of shapes at unit density: `mass` is its volume [m^3]. One shape: in closed
/// form. Several: sums over columns along z of their common frame at Gauss points between the ends of the
/// solids, exact along the column; the volume of a hand's palm is within 0.1 %.
/// @param shapes boxes, capsules, spheres of one frame; @throws Error (input) for others.
MassProperties union_properties(const std::vector<Shape>& shapes);

}  // namespace handsim::model
