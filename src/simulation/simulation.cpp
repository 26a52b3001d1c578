#include "handsim/simulation/simulation.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "handsim/engine/overlap.h"
#include "handsim/model/kinematics.h"

namespace handsim::simulation {

namespace {

using Clock = std::chrono::steady_clock;

/// Deepest that an object may start in a hand [m].
constexpr double kDeepestStart = 1e-3;

double ns_between(Clock::time_point a, Clock::time_point b) {
  return std::chrono::duration<double, std::nano>(b - a).count();
}

/// True where a rule lets the two touch.
bool meet(const model::Model& model, const model::Shape& a, const model::Shape& b) {
  return std::any_of(model.contact_rules.begin(), model.contact_rules.end(),
                     [&](const model::ContactRule& rule) {
                       return (rule.group_a == a.group && rule.group_b == b.group) ||
                              (rule.group_a == b.group && rule.group_b == a.group);
                     });
}

const scene::Scene& checked(const scene::Scene& scene) {
  check_start(scene);
  return scene;
}

}  // namespace

void check_start(const scene::Scene& scene) {
  if (!scene.spec.solver.effects.has(model::Effect::object_contact)) return;
  const auto of_hand = [](const model::Shape& shape) {
    return shape.tint != model::Tint::object && shape.tint != model::Tint::ground &&
           shape.tint != model::Tint::mechanism;
  };
  std::vector<Problem> problems;
  for (const engine::Overlap& overlap :
       engine::initial_overlaps(scene.model, model::initial_state(scene.model))) {
    const model::Shape* hand = &scene.model.shapes[static_cast<std::size_t>(overlap.shape_a)];
    const model::Shape* other = &scene.model.shapes[static_cast<std::size_t>(overlap.shape_b)];
    if (!of_hand(*hand)) std::swap(hand, other);
    if (overlap.depth <= kDeepestStart || !of_hand(*hand) || !meet(scene.model, *hand, *other)) continue;
    const std::string name = other->name.substr(0, other->name.find('.'));
    for (std::size_t i = 0; i < scene.spec.objects.size(); ++i)
      if (const scene::ObjectSpec& object = scene.spec.objects[i];
          other->tint == model::Tint::object && object.name == name && !object.may_overlap)
        problems.push_back(
            {object.place, fmt::format("objects.{}.position", i),
             fmt::format("{} {:.2g} mm inside {} at the start", other->name, 1e3 * overlap.depth, hand->name),
             fmt::format("at most {:g} mm, or overlap: allowed", 1e3 * kDeepestStart)});
  }
  if (!problems.empty()) throw Error(problems);
}

Simulation::Simulation(const scene::Scene& scene)
    : scene_(checked(scene)),
      engine_(engine::make_engine(scene.model, scene.spec.solver)),
      monitor_(scene.model, scene.spec.solver.step,
               scene.spec.solver.effects.has(model::Effect::joint_stops)),
      ledger_(scene.model, scene.spec.solver.effects,
              model::engine_of(scene.spec.solver.method) != model::EngineKind::articulated) {
  if (scene.spec.record_contacts) contact_sums_.emplace(scene.model);
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
  const bool timed = ledger_.times_next();
  const auto now = [&] { return timed ? Clock::now() : Clock::time_point(); };
  const Clock::time_point start = now();
  const engine::StepInput input = command();
  const Clock::time_point commanded = now();
  const engine::StepReport report = engine_->step(input);
  const Clock::time_point stepped = now();
  if (controller_) controller_->observe(engine_->state());
  const Clock::time_point observed = now();
  if (tracking_) tracking_->look(engine_->state().time);
  for (GraspWatch& grasp : grasps_) grasp.look(*engine_);
  monitor_.look(engine_->state());
  if (contact_sums_)
    contact_sums_->look(engine_->contacts(), engine_->state().time, engine_->settings().step);
  ledger_.book(report, engine_->contacts(),
               {.control = ns_between(start, commanded) + ns_between(stepped, observed),
                .step = ns_between(commanded, stepped),
                .check = ns_between(observed, now())});
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
