#include "handsim/simulation/simulation.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <new>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/engine/contact/overlap.h"
#include "handsim/model/kinematics.h"

namespace handsim::simulation {

namespace {

using Clock = std::chrono::steady_clock;

/// Deepest that an object may start in a hand [m].
constexpr double kDeepestStart = 1e-3;
/// Pairs of shapes that are named for one object; more are counted.
constexpr std::size_t kNamedPairs = 10;

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
    return shape.part != model::Part::object && shape.part != model::Part::ground &&
           shape.part != model::Part::mechanism;
  };
  std::vector<Problem> problems;
  std::vector<std::size_t> pairs(scene.spec.objects.size());
  const std::string need = fmt::format("at most {:g} mm, or overlap: allowed", 1e3 * kDeepestStart);
  for (const engine::Overlap& overlap :
       engine::initial_overlaps(scene.model, model::initial_state(scene.model))) {
    const model::Shape* hand = &scene.model.shapes[static_cast<std::size_t>(overlap.shape_a)];
    const model::Shape* other = &scene.model.shapes[static_cast<std::size_t>(overlap.shape_b)];
    if (!of_hand(*hand)) std::swap(hand, other);
    if (overlap.depth <= kDeepestStart || !of_hand(*hand) || !meet(scene.model, *hand, *other)) continue;
    const std::string name = other->name.substr(0, other->name.find('.'));
    for (std::size_t i = 0; i < scene.spec.objects.size(); ++i)
      if (const scene::ObjectSpec& object = scene.spec.objects[i];
          other->part == model::Part::object && object.name == name && !object.may_overlap &&
          ++pairs[i] <= kNamedPairs)
        problems.push_back(
            {object.place, fmt::format("objects.{}.position", i),
             fmt::format("{} {:.2g} mm inside {} at the start", other->name, 1e3 * overlap.depth, hand->name),
             need});
  }
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (pairs[i] > kNamedPairs)
      problems.push_back({scene.spec.objects[i].place, fmt::format("objects.{}.position", i),
                          fmt::format("{} inside hands at {} more places", scene.spec.objects[i].name,
                                      pairs[i] - kNamedPairs),
                          need});
  if (!problems.empty()) throw Error(problems);
}

Simulation::Simulation(const scene::Scene& scene)
    : scene_(checked(scene)),
      engine_(engine::make_engine(scene.model, scene.spec.solver)),
      monitor_(scene.model, scene.spec.solver.step,
               scene.spec.solver.effects.has(model::Effect::joint_stops)),
      ledger_(scene.model, scene.spec.solver.effects,
              model::engine_of(scene.spec.solver.method) != model::EngineKind::articulated),
      convergence_(scene.model) {
  if (engine_->tests_contacts())
    tunnelling_.emplace(scene.model, scene.spec.solver.effects, engine_->state());
  if (scene.spec.record_contacts) contact_sums_.emplace(scene.model);
  hash_.add(engine_->state());
  if (scene.spec.solver.effects.has(model::Effect::actuation)) find_constant_torques();
  for (const scene::GraspPlan& plan : scene.spec.grasp_plans)
    grasps_.emplace_back(scene.model, plan, scene.spec.solver.step);
  // Without actuation nothing pulls.
  if (scene.spec.solver.effects.has(model::Effect::actuation))
    for (const scene::ClimbPlan& plan : scene.spec.climb_plans)
      climbs_.emplace_back(scene.model, plan, scene.spec.solver.step);
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

/// What drives the joints in the next step: the controller, torques that are constant, and climbs.
engine::StepInput Simulation::command() {
  if (controller_) controller_->command(engine_->state());
  if (climbs_.empty() && !controller_) return {.torques = constant_};
  if (climbs_.empty() && constant_.empty()) return {controller_->torques(), controller_->servos()};
  const auto dofs = static_cast<std::size_t>(scene_.model.dof_count());
  sum_ = constant_;
  sum_.resize(dofs);
  servos_.assign(dofs, {});
  if (controller_) {
    const std::span<const double> torques = controller_->torques();
    for (std::size_t i = 0; i < torques.size(); ++i) sum_[i] += torques[i];
    std::copy(controller_->servos().begin(), controller_->servos().end(), servos_.begin());
  }
  for (const ClimbWatch& climb : climbs_) climb.command(engine_->state(), sum_, servos_);
  return {sum_, servos_};
}

void Simulation::step() {
  if (failure_) throw Error(*failure_);
  try {
    advance();
  } catch (const std::bad_alloc&) {
    failure_.emplace(PhysicsFault{state().time, "the run", "memory", "none is left: use fewer bodies"});
    throw Error(*failure_);
  }
}

void Simulation::advance() {
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
  for (ClimbWatch& climb : climbs_) climb.look(*engine_);
  monitor_.look(engine_->state());
  // An engine collides before it moves.
  monitor_.look(engine_->contacts(), engine_->state().time - engine_->settings().step);
  if (tunnelling_) tunnelling_->look(engine_->contacts(), engine_->state());
  convergence_.look(report, engine_->state().time);
  if (contact_sums_)
    contact_sums_->look(engine_->contacts(), engine_->state().time, engine_->settings().step);
  ledger_.book(report, engine_->contacts(),
               {.control = ns_between(start, commanded) + ns_between(stepped, observed),
                .step = ns_between(commanded, stepped),
                .check = ns_between(observed, now())});
  if (steps() % kHashEvery == 0) hash_.add(engine_->state());
  if (monitor_.apart(kLargestGap)) {
    const Peak gap = monitor_.joint_gap();
    failure_.emplace(
        PhysicsFault{gap.time, gap.where, "joint gap [m]",
                     fmt::format("{:g} is beyond {:g}: use a smaller step, more iterations or weaker torques",
                                 gap.value, kLargestGap)});
    throw Error(*failure_);
  }
}

std::vector<std::string> Simulation::warnings() const {
  std::vector<std::string> out = convergence_.warnings(ledger_, scene_.spec.solver);
  if (!tunnelling_) return out;
  const std::vector<std::string> more = tunnelling_->warnings();
  out.insert(out.end(), more.begin(), more.end());
  return out;
}

std::uint64_t Simulation::state_hash() const {
  StateHash all = hash_;
  if (steps() % kHashEvery != 0) all.add(engine_->state());
  return all.value();
}

std::vector<AxisTracking> Simulation::tracking() const {
  if (!tracking_) return {};
  Tracking closed = *tracking_;
  closed.finish(engine_->state().time);
  return closed.axes();
}

RunSnapshot Simulation::snapshot() const {
  if (failure_) throw Error(*failure_);
  if (!fingerprint_) fingerprint_ = std::make_shared<const Fingerprint>(fingerprint(scene_, *engine_));
  ArchiveWriter out;
  out.word(hash_.value());
  ledger_.save(out);
  carry(out, engine_->state());
  engine_->save(out);
  if (controller_) controller_->save(out);
  if (tracking_) tracking_->save(out);
  monitor_.save(out);
  if (contact_sums_) contact_sums_->save(out);
  convergence_.save(out);
  if (tunnelling_) tunnelling_->save(out);
  for (const GraspWatch& grasp : grasps_) grasp.save(out);
  for (const ClimbWatch& climb : climbs_) climb.save(out);
  return {fingerprint_, engine_->state().time, out.take()};
}

void Simulation::restore(const RunSnapshot& snapshot) {
  const RunSnapshot before = this->snapshot();
  if (snapshot.scene != fingerprint_) {
    const std::vector<std::string> other = differences(*snapshot.scene, *fingerprint_);
    if (!other.empty())
      throw input_error("snapshot",
                        fmt::format("one of another scene, which differs in {}", fmt::join(other, ", ")),
                        "one of this scene");
  }
  try {
    restore_parts(snapshot);
  } catch (const Error&) {
    restore_parts(before);
    throw;
  }
}

void Simulation::restore_parts(const RunSnapshot& snapshot) {
  ArchiveReader in(snapshot.bytes, "snapshot");
  hash_.set(in.word());
  ledger_.restore(in);
  model::State state = engine_->state();
  carry(in, state);
  const double step = scene_.spec.solver.step;
  const double time = static_cast<double>(ledger_.steps()) * step;
  if (state.time != snapshot.time || std::abs(time - state.time) > 1e-6 * step)
    in.refuse(fmt::format("a state at {:g} s after {} steps", state.time, ledger_.steps()),
              "times that agree");
  engine_->restore(state, in);
  if (controller_) controller_->restore(in);
  if (tracking_) tracking_->restore(in);
  monitor_.restore(in);
  if (contact_sums_) contact_sums_->restore(in);
  convergence_.restore(in);
  if (tunnelling_) tunnelling_->restore(in);
  if (tunnelling_) tunnelling_->restart(engine_->state());
  for (GraspWatch& grasp : grasps_) grasp.restore(in);
  for (ClimbWatch& climb : climbs_) climb.restore(in);
  in.finish();
}

std::vector<GraspFigures> Simulation::grasps() const {
  std::vector<GraspFigures> out;
  for (const GraspWatch& grasp : grasps_) out.push_back(grasp.figures());
  return out;
}

std::vector<ClimbFigures> Simulation::climbs() const {
  std::vector<ClimbFigures> out;
  for (const ClimbWatch& climb : climbs_) out.push_back(climb.figures());
  return out;
}

bool Simulation::over() const {
  return grasps_.empty() && !climbs_.empty() &&
         std::all_of(climbs_.begin(), climbs_.end(),
                     [&](const ClimbWatch& climb) { return climb.over(engine_->state().time); });
}

bool Simulation::grasp_lost() const {
  return std::any_of(grasps_.begin(), grasps_.end(), [](const GraspWatch& grasp) { return grasp.lost(); });
}

long Simulation::step_count() const {
  return std::max(1L, std::lround(scene_.spec.duration / scene_.spec.solver.step));
}

}  // namespace handsim::simulation
