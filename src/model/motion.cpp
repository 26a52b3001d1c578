#include "handsim/model/motion.h"

#include <algorithm>

namespace handsim::model {

double eased(Interpolation interpolation, double s) {
  switch (interpolation) {
    case Interpolation::linear:
      return s;
    case Interpolation::minimum_jerk:
      return s * s * s * (10 + s * (-15 + 6 * s));
  }
  return s;
}

Pose PoseMotion::at(double time) const {
  if (time <= keys.front().time) return keys.front().pose;
  if (time >= keys.back().time) return keys.back().pose;
  const auto next = std::upper_bound(keys.begin(), keys.end(), time,
                                     [](double t, const PoseKey& key) { return t < key.time; });
  const PoseKey& a = *(next - 1);
  const PoseKey& b = *next;
  const double s = eased(interpolation, (time - a.time) / (b.time - a.time));
  return {a.pose.p + s * (b.pose.p - a.pose.p), a.pose.q.slerp(s, b.pose.q)};
}

}  // namespace handsim::model
