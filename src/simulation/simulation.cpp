#include "handsim/simulation/simulation.h"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace handsim::simulation {

namespace {

using Clock = std::chrono::steady_clock;

double ns_between(Clock::time_point a, Clock::time_point b) {
  return std::chrono::duration<double, std::nano>(b - a).count();
}

}  // namespace

Simulation::Simulation(const scene::Scene& scene)
    : scene_(scene),
      engine_(engine::make_engine(scene.model, scene.spec.solver)),
      monitor_(scene.model, scene.spec.solver.step,
               scene.spec.solver.effects.has(model::Effect::joint_stops)),
      ledger_(scene.model, scene.spec.solver.effects) {
  if (!scene.spec.solver.effects.has(model::Effect::actuation)) return;
  torques_.resize(static_cast<std::size_t>(scene.model.dof_count()));
  for (const model::Joint& joint : scene.model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      torques_[static_cast<std::size_t>(joint.first_dof) + a] = joint.axes[a].torque;
}

void Simulation::step() {
  const Clock::time_point start = Clock::now();
  const engine::StepReport report = engine_->step({torques_});
  const Clock::time_point stepped = Clock::now();
  monitor_.look(engine_->state());
  ledger_.book(report, engine_->contacts(), ns_between(start, stepped), ns_between(stepped, Clock::now()));
}

long Simulation::step_count() const {
  return std::max(1L, std::lround(scene_.spec.duration / scene_.spec.solver.step));
}

}  // namespace handsim::simulation
