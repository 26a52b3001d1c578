// A timed trajectory of a frame: keyframes joined by straight lines or minimum-jerk curves, and shakes on top
// of them. Before the first keyframe and after the last the frame stands still, but for shakes.
#pragma once

#include <vector>

#include "handsim/core/pose.h"

namespace handsim::model {

enum class Interpolation {
  linear,
  minimum_jerk,  ///< 10 s^3 - 15 s^4 + 6 s^5 (Flash & Hogan 1985, J Neurosci 5:1688)
};

struct PoseKey {
  double time = 0;  ///< [s], rising
  Pose pose;        ///< X_WD
};

/// How fast a frame moves.
struct PoseRate {
  Vec3 v = Vec3::Zero();  ///< of its origin, world axes [m/s]
  Vec3 w = Vec3::Zero();  ///< world axes [rad/s]
};

/// On which side of a keyframe a rate is meant: linear motion has a kink there.
enum class KeySide { before, after };

/// A to and fro along a line that starts and ends at rest: displacement = amplitude w(n) sin(2 pi n) with n =
/// frequency (time - start) from 0 to `cycles`; w rises from 0 to 1 over the first half cycle and falls over
/// the last by the minimum-jerk curve. Acceleration is continuous.
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

/// Largest |acceleration| of a shake of unit amplitude and 1 Hz [m/s^2]; at frequency f it is f^2 times that.
double shake_acceleration(int cycles);

struct PoseMotion {
  std::vector<PoseKey> keys;  ///< at least one
  Interpolation interpolation = Interpolation::minimum_jerk;
  std::vector<Shake> shakes;  ///< added to the keyframes' position

  /// Pose at a time [s].
  Pose at(double time) const;
  /// Its rate at a time [s]: the exact derivative of `at`.
  PoseRate rate(double time, KeySide side) const;
  /// How fast that rate changes [m/s^2], [rad/s^2]: its exact derivative.
  PoseRate acceleration(double time, KeySide side) const;
};

/// Fraction of the way, 0..1, after fraction `s` (0..1) of the time.
double eased(Interpolation interpolation, double s);
/// Its derivative.
double eased_rate(Interpolation interpolation, double s);
/// Its second derivative.
double eased_acceleration(Interpolation interpolation, double s);

}  // namespace handsim::model
