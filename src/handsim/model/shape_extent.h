// Support function, bounds and radii of shapes.
#pragma once

#include <vector>

#include "handsim/model/model.h"

namespace handsim::model {

/// Largest n . x over a shape about its centre [m], n unit in its frame: support function; 0 for a plane.
double support(const Shape& shape, const Vec3& n);

/// Distance of a shape's farthest point from the origin of its body [m]; 0 for a plane.
double reach(const Shape& shape);

/// Edge lengths of the bounding box of shapes along the axes of their common frame [m].
Vec3 box_edges(const std::vector<Shape>& shapes);

/// Bounds of a shape: a box around its core and a radius that rounds the core. A mesh has a bounding sphere.
struct Extent {
  Vec3 half = Vec3::Zero();  ///< along the axes of the shape's frame [m]
  double round = 0;          ///< [m]
  double farthest = 0;       ///< distance of the core's farthest point from the shape's centre [m]
};
Extent extent(const Shape& shape);

/// Radius of the largest sphere about a shape's centre that lies in it [m]; infinite for a plane.
double inner_radius(const Shape& shape);

}  // namespace handsim::model
