#include "handsim/scene/compile/extent.h"

#include <algorithm>
#include <limits>

#include "handsim/model/shape_extent.h"

namespace handsim::scene {

Vec3 extent(const std::vector<model::Shape>& shapes) {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const model::Shape& shape : shapes)
    for (int i = 0; i < 3; ++i) {
      const Vec3 n = shape.pose.q.conjugate() * Vec3::Unit(i);
      low[i] = std::min(low[i], shape.pose.p[i] - model::support(shape, -n));
      high[i] = std::max(high[i], shape.pose.p[i] + model::support(shape, n));
    }
  return high - low;
}

}  // namespace handsim::scene
