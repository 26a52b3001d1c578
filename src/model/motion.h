// A timed trajectory of a frame: keyframes joined by straight lines or minimum-jerk curves. Before the
// first keyframe and after the last the frame stands still.
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

struct PoseMotion {
  std::vector<PoseKey> keys;  ///< at least one
  Interpolation interpolation = Interpolation::minimum_jerk;

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
