// The actuator of a climbing palm on its rail: a servo while the fingers close, then a force that grows.
#pragma once

#include <algorithm>
#include <span>

#include "handsim/model/actuation.h"
#include "handsim/model/motion.h"
#include "handsim/scene/task/climb.h"
#include "handsim/simulation/watch/climb_figures.h"

namespace handsim::simulation {

/// The palm's servo while the fingers close: stiff against fingers, critically damped for half a kilogram.
inline constexpr double kRailStiffness = 1e5;  ///< [N/m]
inline constexpr double kRailDamping = 450;    ///< [N s/m]
inline constexpr double kRailLimit = 5000;     ///< [N]

/// Depends only on the state; a snapshot needs no data of it.
struct ClimbLoad {
  const scene::ClimbPlan& plan;
  std::size_t dof;  ///< of the rail
  double step;      ///< of the engine [s]

  /// The rail's action in the step: adds to the forces [N] or sets the servo, both of size model.dof_count().
  void command(const model::State& state, std::span<double> torques, std::span<model::Servo> servos) const {
    const double end = state.time + step;
    if (state.time > plan.loading().start - step / 2) {
      torques[dof] += load_at(plan, end);
      return;
    }
    const scene::TaskPhase& approach = plan.approach();
    const double share = std::clamp((end - approach.start) / (approach.end - approach.start), 0.0, 1.0);
    const double target =
        -plan.height * (1 - model::path_fraction(model::Interpolation::minimum_jerk, share));
    servos[dof] = {kRailStiffness, kRailDamping, target - state.q[dof], 0, kRailLimit};
  }
};

}  // namespace handsim::simulation
