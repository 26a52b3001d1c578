// Joint stops as arcs that an angle has reached or not, decided as ODE decides it. No ODE types.
#pragma once

#include "handsim/model/angle_sensor.h"

namespace handsim::engine::ode {

using model::AngleSensor;
using model::Direction;

/// A stop as an arc: tells without an inverse tangent whether an angle has reached either end.
class StopArc {
 public:
  StopArc(double low, double high);
  /// True at or beyond an end of the arc, ends included, as ODE decides it.
  bool reached(const Direction& at) const;
  /// True where an end is reached by a turn of at most this much [rad]; for some angles a little farther off.
  bool near(const Direction& at, double turn) const;
  double low() const { return low_; }    ///< [rad]
  double high() const { return high_; }  ///< [rad]

 private:
  double low_, high_;
  Direction low_end_, high_end_;
  bool narrow_;  ///< spans less than half a turn
};

}  // namespace handsim::engine::ode
