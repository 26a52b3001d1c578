// Joint stops as arcs that an angle has reached or not, decided as ODE decides it. No ODE types.
#pragma once

#include "handsim/model/angle_sensor.h"

namespace handsim::engine::ode {

using model::Direction;

/// A stop as an arc, which an angle reaches to the last bit of its sine and cosine.
class StopArc {
 public:
  StopArc(double low, double high);
  /// True at or beyond an end of the arc, ends included, as ODE decides it.
  bool reached(const Direction& at) const;
  double low() const { return low_; }    ///< [rad]
  double high() const { return high_; }  ///< [rad]

 private:
  double low_, high_;
  Direction low_end_, high_end_;
  bool narrow_;  ///< spans less than half a turn
};

}  // namespace handsim::engine::ode
