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

double eased_acceleration(Interpolation interpolation, double s) {
  switch (interpolation) {
    case Interpolation::linear:
      return 0;
    case Interpolation::minimum_jerk:
      return 60 * s * (1 - s) * (1 - 2 * s);
  }
  return 0;
}

namespace {

/// The keyframes around a time, on the side that is meant; null before the first and after the last.
const PoseKey* key_before(const std::vector<PoseKey>& keys, double time, KeySide side) {
  const auto next = std::find_if(keys.begin(), keys.end(), [&](const PoseKey& key) {
    return side == KeySide::after ? time < key.time : time <= key.time;
  });
  return next == keys.begin() || next == keys.end() ? nullptr : &*(next - 1);
}

/// The way from a keyframe to the next, `share` of it a second; the turn goes about one axis.
PoseRate along(const PoseKey& a, const PoseKey& b, double share) {
  return {share * (b.pose.p - a.pose.p), share * rotation_vector(b.pose.q * a.pose.q.conjugate())};
}

}  // namespace

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
  const PoseKey* key = key_before(keys, time, side);
  if (!key) return {};
  const double span = key[1].time - key->time;
  return along(*key, key[1], eased_rate(interpolation, (time - key->time) / span) / span);
}

PoseRate PoseMotion::acceleration(double time, KeySide side) const {
  const PoseKey* key = key_before(keys, time, side);
  if (!key) return {};
  const double span = key[1].time - key->time;
  return along(*key, key[1], eased_acceleration(interpolation, (time - key->time) / span) / (span * span));
}

}  // namespace handsim::model
