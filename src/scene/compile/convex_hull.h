// The convex hull of points, by Qhull.
#pragma once

#include <string>
#include <vector>

#include "handsim/core/pose.h"

namespace handsim::scene {

struct Hull {
  std::vector<Vec3> vertices;           ///< those of the points that are its corners
  std::vector<std::vector<int>> faces;  ///< flat polygons, counter-clockwise seen from outside
};

/// @param points finite, at least 4.
/// @throws Error (input) where they span no volume. Thread-safe.
Hull convex_hull(const std::vector<Vec3>& points);

}  // namespace handsim::scene
