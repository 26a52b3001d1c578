#include "handsim/model/motion.h"

#include <algorithm>
#include <cmath>

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

namespace {

/// Window of a shake at n of its cycles, and its derivative by n.
struct Window {
  double value = 0, rate = 0;
};

Window window(double n, int cycles) {
  constexpr double kRamp = 0.5;
  const double inside = std::min(n, cycles - n) / kRamp;
  if (inside <= 0) return {};
  if (inside >= 1) return {1, 0};
  const double sign = n < cycles - n ? 1 : -1;
  return {eased(Interpolation::minimum_jerk, inside),
          sign * eased_rate(Interpolation::minimum_jerk, inside) / kRamp};
}

Pose between_keys(const PoseMotion& motion, double time) {
  const std::vector<PoseKey>& keys = motion.keys;
  if (time <= keys.front().time) return keys.front().pose;
  if (time >= keys.back().time) return keys.back().pose;
  const auto next = std::upper_bound(keys.begin(), keys.end(), time,
                                     [](double t, const PoseKey& key) { return t < key.time; });
  const PoseKey& a = *(next - 1);
  const PoseKey& b = *next;
  const double s = eased(motion.interpolation, (time - a.time) / (b.time - a.time));
  return {a.pose.p + s * (b.pose.p - a.pose.p), a.pose.q.slerp(s, b.pose.q)};
}

PoseRate rate_between_keys(const PoseMotion& motion, double time, KeySide side) {
  const std::vector<PoseKey>& keys = motion.keys;
  // The first key that lies after the time, on the side that is meant.
  const auto next = std::find_if(keys.begin(), keys.end(), [&](const PoseKey& key) {
    return side == KeySide::after ? time < key.time : time <= key.time;
  });
  if (next == keys.begin() || next == keys.end()) return {};
  const PoseKey& a = *(next - 1);
  const PoseKey& b = *next;
  const double span = b.time - a.time;
  const double share = eased_rate(motion.interpolation, (time - a.time) / span) / span;
  // The turn from a to b goes about one axis, so its rate is that turn times the share.
  return {share * (b.pose.p - a.pose.p), share * rotation_vector(b.pose.q * a.pose.q.conjugate())};
}

}  // namespace

Vec3 Shake::displacement(double time) const {
  const double n = frequency * (time - start);
  return window(n, cycles).value * std::sin(2 * M_PI * n) * amplitude;
}

Vec3 Shake::velocity(double time) const {
  const double n = frequency * (time - start);
  const Window w = window(n, cycles);
  const double phase = 2 * M_PI * n;
  return frequency * (w.rate * std::sin(phase) + 2 * M_PI * w.value * std::cos(phase)) * amplitude;
}

double shake_acceleration(int cycles) {
  Shake unit;
  unit.cycles = cycles;
  unit.amplitude = Vec3::UnitX();
  // The window repeats itself: one cycle at either end and one between see all there is.
  constexpr double kStep = 1e-4;
  const int steps = static_cast<int>(std::min(cycles, 2) / kStep);
  double most = 0;
  for (int i = 1; i < steps; ++i) {
    const double t = i * kStep;
    most =
        std::max(most, std::abs((unit.velocity(t + kStep / 2) - unit.velocity(t - kStep / 2)).x()) / kStep);
  }
  return most;
}

Pose PoseMotion::at(double time) const {
  Pose out = between_keys(*this, time);
  for (const Shake& shake : shakes) out.p += shake.displacement(time);
  return out;
}

PoseRate PoseMotion::rate(double time, KeySide side) const {
  PoseRate out = rate_between_keys(*this, time, side);
  for (const Shake& shake : shakes) out.v += shake.velocity(time);
  return out;
}

}  // namespace handsim::model
