#include "handsim/environment/lanes.h"

#include <algorithm>
#include <cmath>

#include "handsim/core/index.h"

namespace handsim::environment {

namespace articulated = engine::articulated;

namespace {

bool finite(std::span<const double> numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); });
}

/// Constants of a controller with implicit gains.
void describe(const control::Controller& controller, articulated::LaneControlPlan& plan,
              const model::Model& model) {
  plan.drives.clear();
  plan.links.clear();
  for (const auto& axis : controller.constants())
    plan.drives.push_back({axis.dof, axis.gains.proportional, axis.gains.derivative, axis.gains.integral,
                           axis.gains.torque_limit, axis.zone, axis.smoothing, axis.tissue_stiffness,
                           axis.tissue_rest, 0});
  const control::GravityLoad* gravity = controller.gravity();
  if (!gravity) return;
  plan.gravity = gravity->gravity();
  for (const auto& link : gravity->links()) {
    const bool turns = link.universal || link.joint->kind == model::JointKind::hinge;
    plan.links.push_back({link.parent, link.child, link.dof, link.mass, model.bodies[link.child].mass,
                          link.adds_to_parent, turns, link.universal, link.joint->child_frame.p,
                          link.first_axis, link.universal ? link.second_axis : Vec3::Zero().eval()});
    if (!turns) plan.links.back().first_axis = Vec3::Zero();
  }
}

}  // namespace

Lanes::Lanes(const Environment& like, int widest)
    : group_(articulated::LaneGroup::make(like.simulation().engine(), widest)),
      step_(like.scene().spec.solver.step) {
  const control::Controller* controller = like.simulation().controller();
  if (controller &&
      (controller->plan().form != control::Form::implicit_gain || controller->plan().feed_forward))
    group_.reset();
}

bool Lanes::takes(Environment& environment, const Action& action) const {
  if (!group_ || environment.failure_ || !action.forces.empty() || !action.wrists.empty() ||
      !action.wrist_rates.empty())
    return false;
  const auto parts = environment.simulation_->parts();
  const auto dofs = at(environment.scene().model.dof_count());
  const std::size_t axes = parts && parts->controller ? parts->controller->axes().size() : 0;
  // What is wrong with an action is told by the environment alone; so is what touches something.
  return parts && (action.torques.empty() || action.torques.size() == dofs) && finite(action.torques) &&
         (action.angles.empty() || action.angles.size() == axes) && finite(action.angles) &&
         parts->engine.contacts().empty() &&
         group_->fits(parts->engine, parts->controller || !action.torques.empty());
}

void Lanes::load(int lane, const Member& member) {
  Environment& environment = *member.environment;
  const simulation::Simulation::Parts parts = *environment.simulation_->parts();
  torques_.assign(parts.constant_torques.begin(), parts.constant_torques.end());
  if (!member.action.torques.empty()) {
    torques_.resize(member.action.torques.size());
    for (std::size_t i = 0; i < torques_.size(); ++i) torques_[i] += member.action.torques[i];
  }
  control::Controller* controller = parts.controller;
  if (group_->key(lane) != environment.numbers_) {
    if (controller) describe(*controller, plan_, environment.scene().model);
    group_->set_constants(lane, parts.engine, controller ? &plan_ : nullptr, environment.numbers_);
  }
  group_->load(lane, parts.engine, torques_);
  if (!controller) return;
  if (member.action.angles.empty())
    controller->release_targets();
  else
    controller->set_targets(member.action.angles);
  for (std::size_t i = 0; i < controller->axes().size(); ++i) {
    const control::AxisState& axis = controller->axis(i);
    group_->set_drive_state(lane, i,
                            {axis.angle, axis.rate, axis.target, axis.torque, axis.at_limit,
                             controller->integral(i), controller->filtered_rate(i)});
  }
}

/// Of the step to come. All environments have the same trajectories, and mostly the same time.
void Lanes::set_targets(std::span<const Member> members, unsigned active) {
  const auto each = [&](const auto& f) {
    for (std::size_t lane = 0; lane < members.size(); ++lane)
      if ((active >> lane) & 1U)
        if (auto* controller = members[lane].environment->simulation_->parts()->controller)
          f(static_cast<int>(lane), *controller, group_->time(static_cast<int>(lane)) + step_);
  };
  std::optional<double> common;
  each([&](int /*lane*/, control::Controller& controller, double time) {
    if (common || controller.targets_given()) return;
    common = time;
    const std::span<const double> targets = controller.targets(time);
    for (std::size_t i = 0; i < controller.constants().size(); ++i)
      group_->set_targets(i, targets[controller.constants()[i].target]);
  });
  each([&](int lane, control::Controller& controller, double time) {
    if (!controller.targets_given() && time == common) return;
    const std::span<const double> targets = controller.targets(time);
    for (std::size_t i = 0; i < controller.constants().size(); ++i)
      group_->set_target(lane, i, targets[controller.constants()[i].target]);
  });
}

void Lanes::store(int lane, Member& member, int made, bool leaves) {
  Environment& environment = *member.environment;
  const simulation::Simulation::Parts parts = *environment.simulation_->parts();
  member.made = made;
  if (parts.controller && made > 0)
    for (std::size_t i = 0; i < parts.controller->axes().size(); ++i) {
      const articulated::LaneDriveState state = group_->drive_state(lane, i);
      parts.controller->axis(i) = {state.angle, state.rate, state.target, state.torque, state.at_limit};
      parts.controller->integral(i) = state.integral;
      parts.controller->filtered_rate(i) = state.filtered_rate;
    }
  group_->store(lane, leaves);
  environment.simulation_->add_steps(made);
  environment.steps_ += made;
}

void Lanes::step(std::span<Member> members, int substeps) {
  unsigned active = 0;
  for (std::size_t lane = 0; lane < members.size(); ++lane) {
    load(static_cast<int>(lane), members[lane]);
    active |= 1U << lane;
  }
  group_->start();
  for (int i = 0; i < substeps && active != 0; ++i) {
    set_targets(members, active);
    const unsigned leave = group_->step();
    for (std::size_t lane = 0; lane < members.size(); ++lane)
      if ((leave >> lane) & 1U) store(static_cast<int>(lane), members[lane], i, true);
    active &= ~leave;
  }
  for (std::size_t lane = 0; lane < members.size(); ++lane)
    if ((active >> lane) & 1U) store(static_cast<int>(lane), members[lane], substeps, false);
}

}  // namespace handsim::environment
