// A cubic spline through samples of several quantities over time: value, rate and acceleration are
// continuous. For recorded motion, whose accelerations straight lines do not have.
#pragma once

#include <span>
#include <vector>

namespace handsim::model {

class CubicSpline {
 public:
  /// Natural spline: no acceleration at the first and the last sample.
  /// @param times increasing, at least one [s]. @param values sample after sample, size times * width.
  CubicSpline(std::vector<double> times, std::vector<double> values, std::size_t width);

  /// Value and derivatives at a time [s], each of size width() or empty; constant beyond the first and last.
  void at(double time, std::span<double> value, std::span<double> rate = {},
          std::span<double> acceleration = {}) const;

  std::size_t width() const { return width_; }
  const std::vector<double>& times() const { return times_; }

 private:
  std::size_t width_;
  std::vector<double> times_, values_;
  std::vector<double> second_;  ///< second derivatives at the samples, as values_
};

}  // namespace handsim::model
