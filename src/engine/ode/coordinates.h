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

 private:
  double low_, high_;
  Direction low_end_, high_end_;
  bool narrow_;  ///< spans less than half a turn
};

}  // namespace handsim::engine::ode
