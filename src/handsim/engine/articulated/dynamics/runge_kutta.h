// Explicit Runge-Kutta methods for motion that is smooth: y' = f(t, y). Knows numbers only.
#pragma once

#include <functional>
#include <span>
#include <vector>

namespace handsim::engine::articulated {

/// Writes y' at (t, y); false where y is out of bounds.
using Slope = std::function<bool(double t, std::span<const double> y, std::span<double> out)>;

class RungeKutta {
 public:
  /// @param size of y; @param weighed components that the error norm counts (empty lanes do not).
  RungeKutta(std::size_t size, std::size_t weighed, Slope slope);

  /// One step of the classical method of order 4 (Kutta 1901). False where f could not be evaluated.
  bool step4(double t, double h, std::span<double> y);

  /// One step of order 8, into `out`, with error estimates of orders 5 and 3: DOP853 (Dormand and Prince
  /// 1989; Hairer, Norsett & Wanner 1993, Solving Ordinary Differential Equations I, section II.5). Returns
  /// the error over what `tolerance`, relative and absolute, allows; negative: f could not be evaluated.
  double try_step8(double t, double h, std::span<const double> y, double tolerance, std::span<double> out);
  /// try_step8 does not evaluate f at its start again until this is called.
  void forget_start() { has_start_ = false; }

 private:
  bool evaluate(std::size_t stage, double t);

  std::size_t size_, weighed_;
  Slope slope_;
  std::vector<std::vector<double>> k_;
  std::vector<double> y_;
  bool has_start_ = false;
};

/// Factor for the next step's size after a step of order 8 with this error (section II.4).
double step_factor8(double error);

}  // namespace handsim::engine::articulated
