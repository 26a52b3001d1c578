// Target angles of one hand over time: knots joined by straight lines, minimum-jerk curves or a spline.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "handsim/core/units.h"
#include "handsim/model/motion.h"
#include "handsim/model/spline.h"

namespace handsim::control {

/// One movement of a program: settling time and overshoot are measured over it.
struct Phase {
  std::string pose;   ///< name of the pose moved to
  double start = 0;   ///< [s]: the target leaves the previous pose
  double arrive = 0;  ///< [s]: the target has reached the pose
  double end = 0;     ///< [s]: the next movement starts; infinity for the last
};

/// Settling time and overshoot are relative to the movement: not computed for smaller movements [rad].
inline constexpr double kSmallestMovement = 5 * kDegree;

class Trajectory {
 public:
  Trajectory() = default;
  /// @param width number of coordinates in each knot.
  Trajectory(std::size_t width, model::Interpolation interpolation)
      : width_(width), interpolation_(interpolation) {}

  /// Adds a knot. Times must not decrease; two knots at the same time make a jump. @param q size width [rad].
  void add(double time, std::span<const double> q);
  void add_phase(Phase phase) { phases_.push_back(std::move(phase)); }

  /// Targets at a time [s] into `out`, size width(). Constant before the first knot and after the last.
  void at(double time, std::span<double> out) const;
  /// Targets at a time, with their exact derivatives by time [rad/s], [rad/s^2], each of size width().
  void at(double time, std::span<double> out, std::span<double> rates, std::span<double> accelerations) const;
  /// Joins the knots by a spline, not straight lines; there must be no jumps. Nothing can be added later.
  void use_spline();
  /// Knot i, size width().
  std::span<const double> knot(std::size_t i) const { return {q_.data() + i * width_, width_}; }
  std::size_t knots() const { return times_.size(); }
  std::size_t width() const { return width_; }
  /// Movements in their order; empty for a motion read from a table.
  const std::vector<Phase>& phases() const { return phases_; }

 private:
  std::size_t width_ = 0;
  model::Interpolation interpolation_ = model::Interpolation::linear;
  std::vector<double> times_;
  std::vector<double> q_;  ///< knot after knot
  std::vector<Phase> phases_;
  std::shared_ptr<const model::CubicSpline> spline_;
};

}  // namespace handsim::control
