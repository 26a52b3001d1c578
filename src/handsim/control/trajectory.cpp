#include "handsim/control/trajectory.h"

#include <algorithm>
#include <cassert>

namespace handsim::control {

void Trajectory::add(double time, std::span<const double> q) {
  assert(q.size() == width_ && (times_.empty() || time >= times_.back()));
  times_.push_back(time);
  q_.insert(q_.end(), q.begin(), q.end());
}

void Trajectory::use_spline() { spline_ = std::make_shared<const model::CubicSpline>(times_, q_, width_); }

void Trajectory::at(double time, std::span<double> out) const { at(time, out, {}, {}); }

void Trajectory::at(double time, std::span<double> out, std::span<double> rates,
                    std::span<double> accelerations) const {
  if (spline_) return spline_->at(time, out, rates, accelerations);
  const auto next = static_cast<std::size_t>(std::ranges::upper_bound(times_, time) - times_.begin());
  const bool ends = next == 0 || next == times_.size();
  const std::span<const double> a = knot(next == 0 ? 0 : next - 1), b = ends ? a : knot(next);
  const double duration = ends ? 1 : times_[next] - times_[next - 1];
  const double share = ends ? 0 : (time - times_[next - 1]) / duration;
  const double s = model::path_fraction(interpolation_, share);
  const double rate = model::path_fraction_rate(interpolation_, share) / duration;
  const double change = model::path_fraction_acceleration(interpolation_, share) / (duration * duration);
  for (std::size_t i = 0; i < width_; ++i) {
    out[i] = ends ? a[i] : a[i] + s * (b[i] - a[i]);
    if (rates.empty()) continue;
    rates[i] = rate * (b[i] - a[i]);
    accelerations[i] = change * (b[i] - a[i]);
  }
}

}  // namespace handsim::control
