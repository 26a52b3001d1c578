#include "handsim/model/spline.h"

#include <algorithm>
#include <cassert>

namespace handsim::model {

// With intervals h_i and slopes d_i the second derivatives m_i satisfy
//   h_{i-1} m_{i-1} + 2 (h_{i-1} + h_i) m_i + h_i m_{i+1} = 6 (d_i - d_{i-1}),  m_0 = m_n = 0.
CubicSpline::CubicSpline(std::vector<double> times, std::vector<double> values, std::size_t width)
    : width_(width), times_(std::move(times)), values_(std::move(values)), second_(values_.size(), 0.0) {
  assert(!times_.empty() && values_.size() == times_.size() * width_);
  const std::size_t n = times_.size();
  if (n < 3) return;
  std::vector<double> upper(n, 0.0);
  const auto span = [&](std::size_t i) { return times_[i + 1] - times_[i]; };
  const auto slope = [&](std::size_t i, std::size_t k) {
    return (values_[(i + 1) * width_ + k] - values_[i * width_ + k]) / span(i);
  };
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const double pivot = 2 * (span(i - 1) + span(i)) - span(i - 1) * upper[i - 1];
    upper[i] = span(i) / pivot;
    for (std::size_t k = 0; k < width_; ++k)
      second_[i * width_ + k] =
          (6 * (slope(i, k) - slope(i - 1, k)) - span(i - 1) * second_[(i - 1) * width_ + k]) / pivot;
  }
  for (std::size_t i = n - 2; i > 0; --i)
    for (std::size_t k = 0; k < width_; ++k)
      second_[i * width_ + k] -= upper[i] * second_[(i + 1) * width_ + k];
}

void CubicSpline::at(double time, std::span<double> value, std::span<double> rate,
                     std::span<double> acceleration) const {
  const auto next = static_cast<std::size_t>(std::ranges::upper_bound(times_, time) - times_.begin());
  const bool outside = next == 0 || (next == times_.size() && time > times_.back()) || times_.size() == 1;
  if (outside) {
    const double* end = values_.data() + (next == 0 ? 0 : (times_.size() - 1) * width_);
    std::copy_n(end, value.size(), value.begin());
    std::ranges::fill(rate, 0.0);
    std::ranges::fill(acceleration, 0.0);
    return;
  }
  const std::size_t i = std::min(next, times_.size() - 1) - 1;
  const double h = times_[i + 1] - times_[i], b = (time - times_[i]) / h, a = 1 - b;
  for (std::size_t k = 0; k < width_; ++k) {
    const double y0 = values_[i * width_ + k], y1 = values_[(i + 1) * width_ + k];
    const double m0 = second_[i * width_ + k], m1 = second_[(i + 1) * width_ + k];
    if (!value.empty())
      value[k] = a * y0 + b * y1 + h * h / 6 * ((a * a * a - a) * m0 + (b * b * b - b) * m1);
    if (!rate.empty()) rate[k] = (y1 - y0) / h + h / 6 * ((3 * b * b - 1) * m1 - (3 * a * a - 1) * m0);
    if (!acceleration.empty()) acceleration[k] = a * m0 + b * m1;
  }
}

}  // namespace handsim::model
