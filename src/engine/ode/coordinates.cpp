#include "handsim/engine/ode/coordinates.h"

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

// A turn by t along the tangent takes the angle by atan(t), so t is tan(turn), or more.
bool StopArc::near(const Direction& at, double turn) const {
  if (!(turn < 0.5)) return true;
  if (!narrow_) {
    // What is outside can be narrower than the turn.
    const double angle = at.angle();
    return angle - turn <= low_ || angle + turn >= high_;
  }
  const double t = 1.1 * turn;
  return reached({at.sin + t * at.cos, at.cos - t * at.sin}) ||
         reached({at.sin - t * at.cos, at.cos + t * at.sin});
}

}  // namespace handsim::engine::ode
