// Joint angles straight from the state, faster than model::joint_coordinates and equal to it: what the
// tissue and the count of stops need at every step. No ODE types.
#pragma once

#include <array>

#include "handsim/model/state.h"

namespace handsim::engine::ode {

/// Sine and cosine of an angle, times one common factor >= 0.
struct Direction {
  double sin = 0;
  double cos = 1;
  double angle() const;  ///< [rad], in (-pi, pi]
};

/// A stop as an arc: tells without an inverse tangent whether an angle has reached either end.
class StopArc {
 public:
  StopArc(double low, double high);
  /// True at or beyond an end of the arc, ends included, as ODE decides it.
  bool reached(const Direction& at) const;

 private:
  double low_, high_;
  Direction low_end_, high_end_;
  bool narrow_;  ///< spans less than half a turn
};

/// Reads the angles of one hinge or universal joint.
class AngleSensor {
 public:
  explicit AngleSensor(const model::Joint& joint);
  /// Directions of the joint's one or two coordinates at a state.
  std::array<Direction, 2> read(const model::State& state) const;

 private:
  bool universal_;
  std::size_t parent_, child_;
  // Hinge: R_FM = q, and (sin, cos) of half its angle are linear in r = conj(q_WP) q_WC (x, y, z, w).
  Eigen::Vector4d half_sin_, half_cos_;
  // Universal with axes a, b and c = a x b, in parent axes (_P, by frame F) and child axes (_C, by frame M).
  Vec3 a_P_, b_P_, c_P_, a_C_, b_C_, c_C_;
};

}  // namespace handsim::engine::ode
