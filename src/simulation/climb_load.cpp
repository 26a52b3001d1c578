#include "handsim/simulation/climb_load.h"

#include <algorithm>

#include "handsim/core/index.h"
#include "handsim/model/motion.h"
#include "handsim/simulation/watch/climb_figures.h"

namespace handsim::simulation {

namespace {

/// The palm's servo while the fingers close: stiff against fingers, critically damped for half a kilogram.
constexpr double kServoStiffness = 1e5;  ///< [N/m]
constexpr double kServoDamping = 450;    ///< [N s/m]
constexpr double kServoLimit = 5000;     ///< [N]

}  // namespace

ClimbLoad::ClimbLoad(const model::Model& model, const scene::ClimbPlan& plan, double step)
    : plan_(plan), dof_(at(model.joints[at(*model.hands[plan.hand].rail)].first_dof)), step_(step) {}

double ClimbLoad::target(double time) const {
  const scene::TaskPhase& approach = plan_.approach();
  const double share = std::clamp((time - approach.start) / (approach.end - approach.start), 0.0, 1.0);
  return -plan_.height * (1 - model::path_fraction(model::Interpolation::minimum_jerk, share));
}

void ClimbLoad::command(const model::State& state, std::span<double> torques,
                        std::span<model::Servo> servos) const {
  const double end = state.time + step_;
  if (state.time > plan_.loading().start - step_ / 2) {
    torques[dof_] += load_at(plan_, end);
    return;
  }
  servos[dof_] = {kServoStiffness, kServoDamping, target(end) - state.q[dof_], 0, kServoLimit};
}

}  // namespace handsim::simulation
