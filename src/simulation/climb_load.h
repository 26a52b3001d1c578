// What moves and loads the palm of a climbing hand on its rail: a servo takes it to the hold and keeps it
// there while the fingers close; then a force along the rail grows with time.
#pragma once

#include "handsim/model/model.h"
#include "handsim/scene/task/climb.h"
#include "handsim/simulation/actuator.h"

namespace handsim::simulation {

class ClimbLoad final : public Actuator {
 public:
  /// The plan must outlive this. @param step of the engine [s].
  ClimbLoad(const model::Model& model, const scene::ClimbPlan& plan, double step);
  void command(const model::State& state, std::span<double> torques,
               std::span<model::Servo> servos) const override;

 private:
  double target(double time) const;

  const scene::ClimbPlan& plan_;
  std::size_t dof_;  ///< of the rail
  double step_;
};

}  // namespace handsim::simulation
