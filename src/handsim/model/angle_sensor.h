// Joint coordinates and rates from the states of bodies: the values of model::joint_coordinates, faster.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "handsim/model/state.h"

namespace handsim::model {

/// Sine and cosine of an angle, times one common factor >= 0.
struct Direction {
  double sin = 0;
  double cos = 1;
  double angle() const;  ///< [rad], in (-pi, pi]
};

/// Measures one hinge or universal joint.
class AngleSensor {
 public:
  explicit AngleSensor(const Joint& joint);
  /// Writes the joint's angles [rad] in (-pi, pi] with sine and cosine, rates [rad/s] and axes in the world.
  void read(const State& state, double* q, double* u, Vec3* axes, Direction* directions) const;

 private:
  void read_angles(const State& state, Direction* directions) const;

  bool universal_;
  std::size_t parent_, child_;
  // Hinge: R_FM = q, and (sin, cos) of half its angle are linear in r = conj(q_WP) q_WC (x, y, z, w).
  Eigen::Vector4d half_sin_, half_cos_;
  // Axes a, b (universal) and c = a x b, in parent axes (_P, by frame F) and child axes (_C, by frame M).
  Vec3 a_P_, b_P_, c_P_, a_C_, b_C_, c_C_;
};

/// Measures all joints of a model, which must outlive this object.
class JointSensors {
 public:
  explicit JointSensors(const Model& model);
  /// Fills q and u of a state from its bodies.
  void read(State& state);
  /// Axes of all coordinates in the world at the state last read, size model.dof_count(); zero for balls.
  std::span<const Vec3> axes() const { return axes_; }
  /// Sine and cosine of all angles; sliders and balls have angle 0 here.
  std::span<const Direction> directions() const { return directions_; }

 private:
  const Model& model_;
  std::vector<std::optional<AngleSensor>> angles_;  ///< by joint; sliders and balls have none
  std::vector<Vec3> axes_;
  std::vector<Direction> directions_;
};

}  // namespace handsim::model
