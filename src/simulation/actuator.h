// What acts on joints beside the controller.
#pragma once

#include <span>

#include "handsim/model/actuation.h"
#include "handsim/model/state.h"

namespace handsim::simulation {

/// Depends on the state alone: it has no memory that a snapshot would have to hold.
class Actuator {
 public:
  virtual ~Actuator() = default;
  /// What acts in the step that begins with a state: adds to the torques [N m] or forces [N] and sets the
  /// servos of coordinates that are its own. Sizes model.dof_count().
  virtual void command(const model::State& state, std::span<double> torques,
                       std::span<model::Servo> servos) const = 0;
};

}  // namespace handsim::simulation
