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
  if (scene.spec.solver.effects.has(model::Effect::actuation)) find_constant_torques();
  for (const scene::GraspPlan& plan : scene.spec.grasp_plans)
    grasps_.emplace_back(scene.model, plan, scene.spec.solver.step);
  if (!scene.control) return;
  controller_.emplace(scene.model, *scene.control, scene.spec.solver.step, engine_->state());
  tracking_.emplace(*controller_, scene.spec.solver.step);
  if (scene.control->form == control::Form::implicit_gain)
    ledger_.set_driven_rows(static_cast<long>(scene.control->axes.size()));
}

void Simulation::find_constant_torques() {
  constant_.resize(static_cast<std::size_t>(scene_.model.dof_count()));
  for (const model::Joint& joint : scene_.model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      constant_[static_cast<std::size_t>(joint.first_dof) + a] = joint.axes[a].torque;
  if (std::all_of(constant_.begin(), constant_.end(), [](double torque) { return torque == 0; }))
    constant_.clear();
}

/// What drives the joints in the next step: the controller, and torques that are constant.
engine::StepInput Simulation::command() {
  if (!controller_) return {.torques = constant_};
  controller_->command(engine_->state());
  const std::span<const double> torques = controller_->torques();
  if (constant_.empty()) return {torques, controller_->servos()};
  sum_ = constant_;
  for (std::size_t i = 0; i < torques.size(); ++i) sum_[i] += torques[i];
  return {sum_, controller_->servos()};
}

void Simulation::step() {
  const Clock::time_point start = Clock::now();
  const engine::StepInput input = command();
  const Clock::time_point commanded = Clock::now();
  const engine::StepReport report = engine_->step(input);
  const Clock::time_point stepped = Clock::now();
  if (controller_) controller_->observe(engine_->state());
  const Clock::time_point observed = Clock::now();
  if (tracking_) tracking_->look(engine_->state().time);
  for (GraspWatch& grasp : grasps_) grasp.look(*engine_);
  monitor_.look(engine_->state());
  ledger_.book(report, engine_->contacts(),
               {.control = ns_between(start, commanded) + ns_between(stepped, observed),
                .step = ns_between(commanded, stepped),
                .check = ns_between(observed, Clock::now())});
}

std::vector<AxisTracking> Simulation::tracking() const {
  if (!tracking_) return {};
  Tracking closed = *tracking_;
  closed.finish(engine_->state().time);
  return closed.axes();
}

std::vector<GraspFigures> Simulation::grasps() const {
  std::vector<GraspFigures> out;
  for (const GraspWatch& grasp : grasps_) out.push_back(grasp.figures());
  return out;
}

bool Simulation::grasp_lost() const {
  return std::any_of(grasps_.begin(), grasps_.end(), [](const GraspWatch& grasp) { return grasp.lost(); });
}

long Simulation::step_count() const {
  return std::max(1L, std::lround(scene_.spec.duration / scene_.spec.solver.step));
}

}  // namespace handsim::simulation
