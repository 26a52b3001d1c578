// How far shapes reach: for posts under objects, and for checks of their size.
#pragma once

#include <vector>

#include "handsim/model/model.h"

namespace handsim::model {

/// Distance from a shape's centre to its outermost point along a direction [m]; 0 for a plane.
/// @param n unit vector in the shape's frame.
double reach(const Shape& shape, const Vec3& n);

/// Edges of the box along the axes of the shapes' common frame that holds them [m].
Vec3 extent(const std::vector<Shape>& shapes);

}  // namespace handsim::model
