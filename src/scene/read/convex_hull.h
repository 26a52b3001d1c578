// The convex hull of points, by Qhull.
#pragma once

#include <string>
#include <vector>

#include "handsim/core/pose.h"

namespace handsim::scene {

/// Points and the polygons between them.
struct Surface {
  std::vector<Vec3> vertices;
  std::vector<std::vector<int>> faces;
};

/// The vertices of the hull and its planar faces, counter-clockwise seen from outside.
/// @param points finite, at least 4.
/// @throws Error (input) if they span no volume. Thread-safe.
Surface convex_hull(const std::vector<Vec3>& points);

}  // namespace handsim::scene
