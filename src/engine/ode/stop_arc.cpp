#include "handsim/engine/ode/stop_arc.h"

#include <cmath>

namespace handsim::engine::ode {

namespace {

Direction direction_of(double angle) { return {std::sin(angle), std::cos(angle)}; }

/// sin(b - a), times both factors.
double sin_between(const Direction& a, const Direction& b) { return b.sin * a.cos - b.cos * a.sin; }

}  // namespace

StopArc::StopArc(double low, double high)
    : low_(low),
      high_(high),
      low_end_(direction_of(low)),
      high_end_(direction_of(high)),
      narrow_(high - low < 3.1) {}

bool StopArc::reached(const Direction& at) const {
  if (narrow_) return !(sin_between(low_end_, at) > 0 && sin_between(at, high_end_) > 0);
  const double angle = at.angle();
  return angle <= low_ || angle >= high_;
}

}  // namespace handsim::engine::ode
