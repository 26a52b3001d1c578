#include "handsim/model/motion.h"

#include <algorithm>
#include <cmath>

namespace handsim::model {

namespace {

/// A function of one variable at a value of it, with its derivatives.
struct Derived {
  double value = 0, rate = 0, acceleration = 0;
};

Derived fraction(Interpolation interpolation, double s) {
  switch (interpolation) {
    case Interpolation::linear:
      return {s, 1, 0};
    case Interpolation::minimum_jerk:
      return {s * s * s * (10 + s * (-15 + 6 * s)), 30 * s * s * (1 - s) * (1 - s),
              60 * s * (1 - s) * (1 - 2 * s)};
  }
  return {s, 1, 0};
}

/// Window of a shake after n of its cycles, by n.
Derived window(double n, int cycles) {
  constexpr double kRamp = 0.5;
  const double inside = std::min(n, cycles - n) / kRamp;
  if (inside <= 0) return {};
  if (inside >= 1) return {1, 0, 0};
  const double sign = n < cycles - n ? 1 : -1;
  const Derived ramp = fraction(Interpolation::minimum_jerk, inside);
  return {ramp.value, sign * ramp.rate / kRamp, ramp.acceleration / (kRamp * kRamp)};
}

/// The keyframe before a time, or at it, by side; null before the first and after the last.
const PoseKey* key_before(const std::vector<PoseKey>& keys, double time, KeySide side) {
  const auto next = std::partition_point(keys.begin(), keys.end(), [&](const PoseKey& key) {
    return side == KeySide::after ? key.time <= time : key.time < time;
  });
  return next == keys.begin() || next == keys.end() ? nullptr : &*(next - 1);
}

/// Difference of two keyframes' poses times a factor [1/s]; the rotation is about one fixed axis.
PoseRate scaled_difference(const PoseKey& a, const PoseKey& b, double factor) {
  return {factor * (b.pose.p - a.pose.p), factor * rotation_vector(b.pose.q * a.pose.q.conjugate())};
}

Pose between_keys(const PoseMotion& motion, double time) {
  const std::vector<PoseKey>& keys = motion.keys;
  if (time <= keys.front().time) return keys.front().pose;
  if (time >= keys.back().time) return keys.back().pose;
  const auto next = std::upper_bound(keys.begin(), keys.end(), time,
                                     [](double t, const PoseKey& key) { return t < key.time; });
  const PoseKey& a = *(next - 1);
  const PoseKey& b = *next;
  const double s = path_fraction(motion.interpolation, (time - a.time) / (b.time - a.time));
  return {a.pose.p + s * (b.pose.p - a.pose.p), a.pose.q.slerp(s, b.pose.q)};
}

}  // namespace

double path_fraction(Interpolation interpolation, double s) { return fraction(interpolation, s).value; }
double path_fraction_rate(Interpolation interpolation, double s) { return fraction(interpolation, s).rate; }
double path_fraction_acceleration(Interpolation interpolation, double s) {
  return fraction(interpolation, s).acceleration;
}

Vec3 Shake::displacement(double time) const {
  const double n = frequency * (time - start);
  return window(n, cycles).value * std::sin(2 * M_PI * n) * amplitude;
}

Vec3 Shake::velocity(double time) const {
  const double n = frequency * (time - start);
  const Derived w = window(n, cycles);
  const double phase = 2 * M_PI * n;
  return frequency * (w.rate * std::sin(phase) + 2 * M_PI * w.value * std::cos(phase)) * amplitude;
}

Vec3 Shake::acceleration(double time) const {
  const double n = frequency * (time - start);
  const Derived w = window(n, cycles);
  const double phase = 2 * M_PI * n;
  return frequency * frequency *
         ((w.acceleration - 4 * M_PI * M_PI * w.value) * std::sin(phase) +
          4 * M_PI * w.rate * std::cos(phase)) *
         amplitude;
}

double shake_acceleration(int cycles) {
  Shake unit;
  unit.cycles = cycles;
  unit.amplitude = Vec3::UnitX();
  // All middle cycles are equal, so two cycles contain the largest value.
  constexpr double kStep = 1e-4;
  const int steps = static_cast<int>(std::min(cycles, 2) / kStep);
  double most = 0;
  for (int i = 1; i < steps; ++i) most = std::max(most, std::abs(unit.acceleration(i * kStep).x()));
  return most;
}

Pose PoseMotion::at(double time) const {
  Pose out = between_keys(*this, time);
  for (const Shake& shake : shakes) out.p += shake.displacement(time);
  return out;
}

PoseRate PoseMotion::rate(double time, KeySide side) const {
  PoseRate out;
  if (const PoseKey* key = key_before(keys, time, side)) {
    const double span = key[1].time - key->time;
    out =
        scaled_difference(*key, key[1], path_fraction_rate(interpolation, (time - key->time) / span) / span);
  }
  for (const Shake& shake : shakes) out.v += shake.velocity(time);
  return out;
}

PoseRate PoseMotion::acceleration(double time, KeySide side) const {
  PoseRate out;
  if (const PoseKey* key = key_before(keys, time, side)) {
    const double span = key[1].time - key->time;
    out = scaled_difference(
        *key, key[1], path_fraction_acceleration(interpolation, (time - key->time) / span) / (span * span));
  }
  for (const Shake& shake : shakes) out.v += shake.acceleration(time);
  return out;
}

}  // namespace handsim::model
