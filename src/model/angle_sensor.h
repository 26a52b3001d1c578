// Joint angles and rates straight from the state, faster than model::joint_coordinates and equal to it: what
// is needed of every joint at every step (passive tissue, the count of stops, controllers).
#pragma once

#include <array>

#include "handsim/model/state.h"

namespace handsim::model {

/// Sine and cosine of an angle, times one common factor >= 0.
struct Direction {
  double sin = 0;
  double cos = 1;
  double angle() const;  ///< [rad], in (-pi, pi]
};

/// Reads the angles of one hinge or universal joint.
class AngleSensor {
 public:
  explicit AngleSensor(const Joint& joint);
  /// Directions of the joint's one or two coordinates at a state.
  std::array<Direction, 2> read(const State& state) const;
  /// Rates of its one or two coordinates [rad/s], as model::joint_rates.
  std::array<double, 2> rates(const State& state) const;

 private:
  bool universal_;
  std::size_t parent_, child_;
  // Hinge: R_FM = q, and (sin, cos) of half its angle are linear in r = conj(q_WP) q_WC (x, y, z, w).
  Eigen::Vector4d half_sin_, half_cos_;
  // Axes a, b (universal) and c = a x b, in parent axes (_P, by frame F) and child axes (_C, by frame M).
  Vec3 a_P_, b_P_, c_P_, a_C_, b_C_, c_C_;
};

}  // namespace handsim::model
