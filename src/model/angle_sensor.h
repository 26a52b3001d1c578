// Joint coordinates and rates straight from the poses and velocities of bodies, faster than
// model::joint_coordinates and equal to it: for engines whose unknowns are the bodies, once a step.
#pragma once

#include <array>

#include "handsim/model/state.h"

namespace handsim::model {

/// Reads one hinge or universal joint.
class AngleSensor {
 public:
  explicit AngleSensor(const Joint& joint);
  /// The joint's one or two angles [rad], in (-pi, pi].
  std::array<double, 2> angles(const State& state) const;
  /// Axes of its coordinates in the world; the second zero for a hinge.
  std::array<Vec3, 2> axes(const State& state) const;
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

/// Reads all joints of a model, which must outlive this.
class JointSensors {
 public:
  explicit JointSensors(const Model& model);
  /// Fills q and u of a state from its bodies.
  void read(State& state) const;
  /// Axes of a joint's coordinates in the world; zero where it has none (see Joint::axes).
  std::array<Vec3, 2> axes(std::size_t joint, const State& state) const;

 private:
  const Model& model_;
  std::vector<std::optional<AngleSensor>> angles_;  ///< by joint; sliders and balls have none
};

}  // namespace handsim::model
