// Nearest points of two line segments: the axes of capsules.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "handsim/core/pose.h"

namespace handsim::engine {

/// Where segments through p and q, half as long as a and b reach, are nearest: p + s a and q + t b, both -1
/// to 1 (Ericson 2005, section 5.1.9).
inline std::pair<double, double> nearest_of_segments(const Vec3& p, const Vec3& a, const Vec3& q,
                                                     const Vec3& b) {
  const Vec3 r = p - q;
  const double aa = a.squaredNorm(), bb = b.squaredNorm(), ab = a.dot(b), ar = a.dot(r), br = b.dot(r);
  const double det = aa * bb - ab * ab;
  const auto within = [](double x) { return std::clamp(x, -1.0, 1.0); };
  double s = det > 0 ? within((ab * br - ar * bb) / det) : 0;
  double t = bb > 0 ? (ab * s + br) / bb : 0;
  if (std::abs(t) > 1 || !(bb > 0)) {
    t = within(t);
    s = aa > 0 ? within((ab * t - ar) / aa) : 0;
  }
  return {s, t};
}

}  // namespace handsim::engine
