// The actuator of a climbing palm on its rail: a servo while the fingers close, then a force that grows.
#pragma once

#include <span>

#include "handsim/model/actuation.h"
#include "handsim/model/state.h"
#include "handsim/scene/task/climb.h"

namespace handsim::simulation {

/// Depends only on the state; a snapshot needs no data of it.
class ClimbLoad {
 public:
  /// The plan must outlive this. @param step of the engine [s].
  ClimbLoad(const model::Model& model, const scene::ClimbPlan& plan, double step);
  /// The rail's action in the step: adds to the forces [N] or sets the servo, both of size model.dof_count().
  void command(const model::State& state, std::span<double> torques, std::span<model::Servo> servos) const;

 private:
  double target(double time) const;

  const scene::ClimbPlan& plan_;
  std::size_t dof_;  ///< of the rail
  double step_;
};

}  // namespace handsim::simulation
