// Driven bodies: each step they get the velocities that carry them exactly to their drive's pose at the
// end of the step. The error of one step is made good in the next, so none adds up.
#pragma once

#include <span>
#include <vector>

#include "handsim/engine/contact/sweep.h"
#include "handsim/engine/ode/bodies.h"

namespace handsim::engine::ode {

class Drives {
 public:
  /// The model and the bodies must outlive this.
  Drives(const model::Model& model, const std::vector<OdeBody>& bodies);
  /// Sets the velocities for the step that ends at time `end` [s] and takes `step` [s].
  void set_velocities(double end, double step);
  /// The same towards X_WD of each drive, which its body has to reach in `remaining` [s] from now.
  void set_velocities(std::span<const Pose> targets, double remaining, double step);
  /// Where the bodies go in the step aimed for.
  std::span<const Prospect::Driven> ways() const { return ways_; }

 private:
  void set_velocity(const model::Drive& drive, const Pose& frame, double remaining, double step);

  const model::Model& model_;
  const std::vector<OdeBody>& bodies_;
  std::vector<Prospect::Driven> ways_;
};

}  // namespace handsim::engine::ode
