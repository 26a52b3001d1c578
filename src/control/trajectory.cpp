#include "handsim/control/trajectory.h"

#include <algorithm>
#include <cassert>

namespace handsim::control {

void Trajectory::add(double time, std::span<const double> q) {
  assert(q.size() == width_ && (times_.empty() || time >= times_.back()));
  times_.push_back(time);
  q_.insert(q_.end(), q.begin(), q.end());
}

void Trajectory::at(double time, std::span<double> out) const {
  const auto next =
      static_cast<std::size_t>(std::upper_bound(times_.begin(), times_.end(), time) - times_.begin());
  if (next == 0 || next == times_.size()) {
    const std::span<const double> end = knot(next == 0 ? 0 : next - 1);
    std::copy(end.begin(), end.end(), out.begin());
    return;
  }
  const std::span<const double> a = knot(next - 1);
  const std::span<const double> b = knot(next);
  const double share = (time - times_[next - 1]) / (times_[next] - times_[next - 1]);
  const double s = model::path_fraction(interpolation_, share);
  for (std::size_t i = 0; i < width_; ++i) out[i] = a[i] + s * (b[i] - a[i]);
}

}  // namespace handsim::control
