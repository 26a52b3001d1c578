// A timed trajectory of a frame: keyframes joined by straight lines or minimum-jerk curves, plus shakes.
// Before the first keyframe and after the last the frame is at rest, except for shakes.
#pragma once

#include <vector>

#include "handsim/core/pose.h"

namespace handsim::model {

enum class Interpolation {
  linear,
  minimum_jerk,  ///< 10 s^3 - 15 s^4 + 6 s^5 (Flash & Hogan 1985, J Neurosci 5:1688)
};

struct PoseKey {
  double time = 0;  ///< [s], increasing
  Pose pose;        ///< X_WD
};

/// Velocity of a frame, or its derivative.
struct PoseRate {
  Vec3 v = Vec3::Zero();  ///< of its origin, world axes [m/s]
  Vec3 w = Vec3::Zero();  ///< world axes [rad/s]
};

/// The side of the derivative at a keyframe, where the rate of linear motion jumps.
enum class KeySide { before, after };

/// An oscillation along a line, at rest at its start and end: displacement = amplitude w(n) sin(2 pi n) with
/// n = frequency (time - start) from 0 to `cycles`; w rises from 0 to 1 over the first half cycle and falls
/// over the last by the minimum-jerk curve. Acceleration is continuous.
struct Shake {
  double start = 0;               ///< [s]
  double frequency = 1;           ///< [Hz], > 0
  int cycles = 2;                 ///< >= 1
  Vec3 amplitude = Vec3::Zero();  ///< world [m]

  double end() const { return start + cycles / frequency; }
  Vec3 displacement(double time) const;
  Vec3 velocity(double time) const;
  Vec3 acceleration(double time) const;
};

/// Largest |acceleration| of a shake of amplitude 1 m at 1 Hz [m/s^2]; it grows with frequency squared.
double shake_acceleration(int cycles);

struct PoseMotion {
  std::vector<PoseKey> keys;  ///< at least one
  Interpolation interpolation = Interpolation::minimum_jerk;
  std::vector<Shake> shakes;  ///< added to the keyframes' position

  /// Pose at a time [s].
  Pose at(double time) const;
  /// The exact derivative of at() at a time [s].
  PoseRate rate(double time, KeySide side) const;
  /// The exact derivative of rate() [m/s^2], [rad/s^2].
  PoseRate acceleration(double time, KeySide side) const;
};

/// Fraction of the path, 0..1, after the fraction `s` (0..1) of the time.
double path_fraction(Interpolation interpolation, double s);
/// Derivative of path_fraction() by `s`.
double path_fraction_rate(Interpolation interpolation, double s);
/// Its second derivative by `s`.
double path_fraction_acceleration(Interpolation interpolation, double s);

}  // namespace handsim::model
