// The convex hull of points, by Qhull.
#pragma once

#include <string>
#include <vector>

#include "handsim/core/pose.h"

namespace handsim::scene {

/// Polygons between points.
struct Surface {
  std::vector<Vec3> vertices;
  std::vector<std::vector<int>> faces;
};

/// The points that are corners of the hull, and its flat faces, counter-clockwise from outside.
/// @param points finite, at least 4.
/// @throws Error (input) where they span no volume. Thread-safe.
Surface convex_hull(const std::vector<Vec3>& points);

}  // namespace handsim::scene
