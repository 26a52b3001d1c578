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

double eased_rate(Interpolation interpolation, double s) {
  switch (interpolation) {
    case Interpolation::linear:
      return 1;
    case Interpolation::minimum_jerk:
      return 30 * s * s * (1 - s) * (1 - s);
  }
  return 1;
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

PoseRate PoseMotion::rate(double time, KeySide side) const {
  // The first key that lies after the time, on the side that is meant.
  const auto next = std::find_if(keys.begin(), keys.end(), [&](const PoseKey& key) {
    return side == KeySide::after ? time < key.time : time <= key.time;
  });
  if (next == keys.begin() || next == keys.end()) return {};
  const PoseKey& a = *(next - 1);
  const PoseKey& b = *next;
  const double span = b.time - a.time;
  const double share = eased_rate(interpolation, (time - a.time) / span) / span;
  // The turn from a to b goes about one axis, so its rate is that turn times the share.
  return {share * (b.pose.p - a.pose.p), share * rotation_vector(b.pose.q * a.pose.q.conjugate())};
}

}  // namespace handsim::model
