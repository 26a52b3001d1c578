#include "handsim/simulation/simulation.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <new>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/engine/checks.h"
#include "handsim/engine/collision/overlap.h"
#include "handsim/engine/collision/pair_table.h"
#include "handsim/engine/muscles.h"
#include "handsim/model/kinematics.h"
#include "handsim/scene/read/engine_choice.h"

namespace handsim::simulation {

namespace {

using Clock = std::chrono::steady_clock;

constexpr double kDeepestStart = 1e-3;   ///< Deepest that an object may start in a hand [m].
constexpr long kTimedEvery = 16;         ///< Steps from one that is timed to the next.
constexpr std::size_t kNamedPairs = 10;  ///< Pairs of shapes that are named for one object; more are counted.

double ns_between(Clock::time_point a, Clock::time_point b) {
  return std::chrono::duration<double, std::nano>(b - a).count();
}

std::shared_ptr<const scene::Scene> checked(std::shared_ptr<const scene::Scene> scene) {
  if (scene::asks_for_step(scene->resolved))
    throw input_error("solver.step", "auto",
                      "a step: handsim run and handsim grasp choose one, and write it into resolved.yaml");
  check_start(*scene);
  return scene;
}

}  // namespace

void check_start(const scene::Scene& scene) {
  if (!scene.spec.solver.effects.has(model::Effect::object_contact)) return;
  const auto of_hand = [](const model::Shape& shape) { return hand_part(shape.part).has_value(); };
  std::vector<std::map<std::pair<std::string, std::string>, double>> deepest(scene.plans.objects.size());
  const engine::PairTable rules(scene.model);
  const std::string need = fmt::format("at most {:g} mm, or overlap: allowed", 1e3 * kDeepestStart);
  const std::vector<std::optional<std::size_t>> object_of = scene.model.objects_of_shapes();
  for (const engine::Overlap& overlap :
       engine::initial_overlaps(scene.model, model::initial_state(scene.model))) {
    int hand_shape = overlap.shape_a, other_shape = overlap.shape_b;
    if (!of_hand(scene.model.shapes[as_index(hand_shape)])) std::swap(hand_shape, other_shape);
    const model::Shape &hand = scene.model.shapes[as_index(hand_shape)],
                       &other = scene.model.shapes[as_index(other_shape)];
    const std::optional<std::size_t> object = object_of[as_index(other_shape)];
    if (overlap.depth <= kDeepestStart || !of_hand(hand) || !object || !rules.meet(hand.group, other.group) ||
        scene.plans.objects[*object].may_overlap)
      continue;
    double& depth = deepest[*object][{other.name, scene.model.bodies[as_index(hand.body)].name}];
    depth = std::max(depth, overlap.depth);
  }
  std::vector<Problem> problems;
  for (std::size_t i = 0; i < deepest.size(); ++i) {
    const scene::ObjectSpec& object = scene.plans.objects[i];
    const std::string key = fmt::format("objects.{}.position", i);
    std::size_t named = 0;
    for (const auto& [pair, depth] : deepest[i])
      if (++named <= kNamedPairs)
        problems.push_back(
            {object.place, key,
             fmt::format("{} {:.2g} mm inside {} at the start", pair.first, 1e3 * depth, pair.second), need});
    if (named > kNamedPairs)
      problems.push_back({object.place, key,
                          fmt::format("{} inside hands at {} more places", object.name, named - kNamedPairs),
                          need});
  }
  if (!problems.empty()) throw Error(problems);
}

void place_start(const scene::Scene& scene, std::span<const double> q, std::span<const double> u,
                 model::State& state) {
  std::vector<Problem> problems;
  const bool stops = scene.spec.solver.effects.has(model::Effect::joint_stops);
  for (const model::Joint& joint : scene.model.joints) {
    for (std::size_t a = 0; a < as_index(model::dof_count(joint.kind)); ++a) {
      const bool slides = joint.slides(a);
      const std::size_t i = as_index(joint.first_dof) + a;
      const model::JointAxis* axis = a < joint.axes.size() ? &joint.axes[a] : nullptr;
      const auto refuse = [&](const char* of, double got, std::string need) {
        problems.push_back({std::nullopt,
                            fmt::format("{}.{}{}", of, joint.name, axis ? "." + axis->name : ""),
                            fmt::format("{:g}", got), std::move(need)});
      };
      if (!std::isfinite(u[i])) refuse("u", u[i], "a finite number");
      model::Stop range{-std::numbers::pi, std::numbers::pi};
      if (slides) range = {-std::numeric_limits<double>::max(), std::numeric_limits<double>::max()};
      const bool stopped = stops && axis && axis->stop;
      if (stopped) range = *axis->stop;
      const double beyond = !stopped ? 0 : slides ? kSliderBeyondStop : kBeyondStop;
      if (!(q[i] >= range.low - beyond && q[i] <= range.high + beyond))
        refuse("q", q[i],
               fmt::format("{:.4g} to {:.4g} {}{}", range.low, range.high, joint.unit(a),
                           stopped ? ", within its stops" : ""));
    }
  }
  if (!problems.empty()) throw Error(std::move(problems));
  model::place_joints(scene.model, q, u, state);
}

/// Made when first asked for, by whichever thread.
struct Simulation::LazyFingerprint {
  std::once_flag once;
  std::shared_ptr<const Fingerprint> value;
};

Simulation::Simulation(std::shared_ptr<const scene::Scene> scene, MakeWatchers watchers)
    : scene_(checked(std::move(scene))),
      engine_(engine::make_engine(scene_->model, scene_->spec.solver)),
      maker_(std::move(watchers)),
      fingerprint_(std::make_shared<LazyFingerprint>()) {
  const scene::SceneSpec& spec = scene_->spec;
  const double step = spec.solver.step;
  if (spec.solver.effects.has(model::Effect::actuation)) {
    compute_constant_torques();
    for (const scene::ClimbPlan& plan : scene_->plans.climbs) {
      const model::Model& model = scene_->model;
      climbs_.push_back(
          {plan, as_index(model.joints[as_index(*model.hands[plan.hand].rail)].first_dof), step});
    }
  }
  make_controller();
  make_watchers();
}

void Simulation::make_controller() {
  const double step = scene_->spec.solver.step;
  std::vector<std::size_t> driven;
  if (scene_->control) {
    controller_ =
        std::make_unique<control::Controller>(scene_->model, *scene_->control, step, engine_->state());
    for (const control::DrivenAxis& axis : scene_->control->axes) driven.push_back(axis.dof);
  }
  if (scene_->muscles)
    drive_ = std::make_unique<control::MuscleDrive>(model(), *scene_->muscles, std::move(driven), step);
}

void Simulation::save_motion(ArchiveWriter& out) const {
  engine_->save(out);
  if (controller_) controller_->save(out);
  if (drive_) drive_->save(out);
  out(excitations_);
}

void Simulation::restore_motion(const model::State& state, ArchiveReader& in) {
  engine_->restore(state, in);
  if (controller_) controller_->restore(in);
  if (drive_) drive_->restore(in);
  in(excitations_);
  const auto sound = [](double excitation) { return excitation >= 0 && excitation <= 1; };
  if (!excitations_.empty() &&
      (excitations_.size() != model().muscles.size() || !std::ranges::all_of(excitations_, sound)))
    in.refuse(fmt::format("{} excitations, or one outside 0 to 1", excitations_.size()),
              fmt::format("none, or {} of 0 to 1", model().muscles.size()));
  report_ = {};
}

void Simulation::make_watchers() {
  watchers_ = maker_({*scene_, *engine_, controller_.get()});
  timed_ = std::ranges::any_of(watchers_, [](const auto& watcher) { return watcher->wants_times(); });
}

void Simulation::compute_constant_torques() {
  constant_.resize(as_index(model().dof_count()));
  for (const model::Joint& joint : model().joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      constant_[as_index(joint.first_dof) + a] = joint.axes[a].torque;
  if (std::ranges::all_of(constant_, [](double torque) { return torque == 0; })) constant_.clear();
}

/// The engine's own checks, before anything has changed.
void Simulation::check(const engine::StepInput& action) const {
  // The time of a fault that is not told.
  if (const auto fault = engine::input_fault(model(), engine_->settings(), 0, action))
    throw input_error("action." + fault->where, fault->quantity + ": " + fault->detail, "finite numbers");
}

/// The step's excitations: the caller's, else those of the scene's drive, which may take the place of motors.
engine::StepInput Simulation::excite(engine::StepInput input, const engine::StepInput& action) {
  input.excitations = action.excitations;
  if (drive_) {
    const std::span<const double> found = drive_->excitations(engine_->state(), input.torques, input.servos);
    if (drive_->takes_torques()) {
      input.torques = action.torques;
      input.servos = action.servos;
    }
    if (action.excitations.empty()) input.excitations = found;
  }
  excitations_.assign(input.excitations.begin(), input.excitations.end());
  return input;
}

/// The input of the next step: what the controller, constant torques, climbs and the caller ask for.
engine::StepInput Simulation::command(const engine::StepInput& action) {
  if (controller_) controller_->command(engine_->state());
  if (climbs_.empty() && action.torques.empty() && action.servos.empty()) {
    engine::StepInput input = action;
    input.torques = constant_;
    if (!controller_) return input;
    if (constant_.empty()) {
      input.torques = controller_->torques();
      input.servos = controller_->servos();
      return input;
    }
  }
  const auto dofs = as_index(model().dof_count());
  bool any_servos = !climbs_.empty() || !action.servos.empty();
  sum_ = constant_;
  sum_.resize(dofs);
  servos_.assign(dofs, {});
  const auto add = [&](std::span<const double> torques) {
    for (std::size_t i = 0; i < torques.size(); ++i) sum_[i] += torques[i];
  };
  if (controller_) {
    add(controller_->torques());
    std::ranges::copy(controller_->servos(), servos_.begin());
    any_servos = any_servos || !controller_->servos().empty();
  }
  for (const ClimbLoad& climb : climbs_) climb.command(engine_->state(), sum_, servos_);
  add(action.torques);
  for (std::size_t i = 0; i < action.servos.size(); ++i)
    if (action.servos[i].limit > 0) servos_[i] = action.servos[i];
  return {sum_, any_servos ? std::span<const model::Servo>(servos_) : std::span<const model::Servo>(),
          action.forces, action.drive_targets, action.excitations};
}

void Simulation::step(const engine::StepInput& action, std::span<const double> angles) {
  if (failure_) throw Error(*failure_);
  if (!angles.empty() && !controller_)
    throw input_error("angles", fmt::format("{} angles in a scene that drives no joint", angles.size()),
                      "a scene with control");
  check(action);
  if (controller_ && angles.empty()) controller_->release_targets();
  if (!angles.empty()) controller_->set_targets(angles);
  keep_failure([&] { advance(action); });
}

/// Runs what moves the engine.
template <class Work>
void Simulation::keep_failure(const Work& work) {
  try {
    try {
      work();
    } catch (const std::bad_alloc&) {
      throw Error(PhysicsFault{state().time, "the run", "memory", "none is left: use fewer bodies"});
    }
  } catch (const Error& error) {
    if (error.fault()) failure_.emplace(error);
    throw;
  }
}

/// After a failure: all parts are new, at the scene's start.
void Simulation::revive() {
  if (!failure_) return;
  engine_ = engine::make_engine(model(), scene_->spec.solver);
  failure_.reset();
  report_ = {};
  excitations_.clear();
  make_controller();
  make_watchers();
}

void Simulation::advance(const engine::StepInput& action) {
  const bool timed = timed_ && steps_ % kTimedEvery == kTimedEvery / 2;
  const auto now = [&] { return timed ? Clock::now() : Clock::time_point(); };
  const Clock::time_point start = now();
  const engine::StepInput input = excite(command(action), action);
  const Clock::time_point commanded = now();
  report_ = engine_->step(input);
  const engine::StepReport& report = report_;
  const Clock::time_point stepped = now();
  if (controller_) controller_->observe(engine_->state());
  ++steps_;
  if (watchers_.empty()) return;
  const Clock::time_point observed = now();
  const StepTimes times{ns_between(start, commanded) + ns_between(stepped, observed),
                        ns_between(commanded, stepped), observed};
  Step made{*engine_, report, timed ? &times : nullptr};
  for (const auto& watcher : watchers_) watcher->update(made);
  if (made.fault) throw Error(std::move(*made.fault));
}

std::uint64_t Simulation::state_hash() const { return get<RunHash>().value(); }

std::vector<Verdict> Simulation::verdicts() const {
  std::vector<Verdict> out;
  for (const auto& watcher : watchers_) watcher->add_verdicts(scene_->spec.criteria, out);
  return out;
}

std::vector<std::string> Simulation::warnings() const {
  std::vector<std::string> out;
  for (const auto& watcher : watchers_) watcher->add_warnings(out);
  return out;
}

long Simulation::step_count() const {
  return std::max(1L, std::lround(scene_->spec.duration / scene_->spec.solver.step));
}

const std::shared_ptr<const Fingerprint>& Simulation::fingerprint() const {
  std::call_once(fingerprint_->once, [&] {
    fingerprint_->value = std::make_shared<const Fingerprint>(simulation::fingerprint(*scene_, *engine_));
  });
  return fingerprint_->value;
}

RunSnapshot Simulation::snapshot() const {
  if (failure_) throw Error(*failure_);
  ArchiveWriter out;
  out(steps_);
  serialize(out, engine_->state());
  save_motion(out);
  out(watchers_.size());
  for (const auto& watcher : watchers_) {
    out.word(hash_bytes(watcher->name()));
    ArchiveWriter part;
    watcher->save(part);
    out(part.bytes());
  }
  const std::uint64_t sum = hash_bytes(out.bytes());
  return {fingerprint(), engine_->state().time, out.take(), sum};
}

void Simulation::restore(const RunSnapshot& snapshot) {
  const std::vector<std::string> other = snapshot.scene == fingerprint()
                                             ? std::vector<std::string>()
                                             : differences(*snapshot.scene, *fingerprint());
  if (!other.empty())
    throw input_error("snapshot",
                      fmt::format("one of another scene, which differs in {}", fmt::join(other, ", ")),
                      "one of this scene");
  revive();
  // Its own bytes, as they were written.
  if (snapshot.scene == fingerprint() && snapshot.sum == hash_bytes(snapshot.bytes)) {
    restore_parts(snapshot);
    return;
  }
  const RunSnapshot before = this->snapshot();
  try {
    restore_parts(snapshot);
  } catch (const Error&) {
    restore_parts(before);
    throw;
  }
}

void Simulation::restore_parts(const RunSnapshot& snapshot) {
  ArchiveReader in(snapshot.bytes, "snapshot");
  long steps = 0;
  in(steps);
  model::State state = engine_->state();
  serialize(in, state);
  const double step = scene_->spec.solver.step;
  const double time = static_cast<double>(steps) * step;
  // A start may be at any time, and `reset(state)` rounds it to half a step; sums of steps add rounding
  // errors.
  if (state.time != snapshot.time || !(std::abs(time - state.time) <= 0.6 * step))
    in.refuse(fmt::format("a state at {:g} s after {} steps", state.time, steps), "times that agree");
  restore_motion(state, in);
  steps_ = steps;
  std::map<std::uint64_t, std::string> parts;  // by the hash of the watcher's name
  for (std::size_t n = in.size(); n > 0; --n) {
    const std::uint64_t name = in.word();
    in(parts[name]);
  }
  in.finish();
  for (const auto& watcher : watchers_) {
    const auto part = parts.find(hash_bytes(watcher->name()));
    if (part == parts.end())
      in.refuse(fmt::format("a snapshot without the watcher {}", watcher->name()), "one that has it");
    ArchiveReader of_part(part->second, "snapshot");
    watcher->restore(of_part, engine_->state());
    of_part.finish();
  }
}

MotionSnapshot Simulation::motion() const {
  if (failure_) throw Error(*failure_);
  MotionSnapshot out;
  out.lineage_ = scene_->lineage;
  out.steps_ = steps_;
  out.state_ = engine_->state();
  ArchiveWriter bytes;
  save_motion(bytes);
  out.bytes_ = bytes.take();
  return out;
}

void Simulation::reset() { reset(model::initial_state(model())); }

void Simulation::reset(const MotionSnapshot& motion) {
  if (motion.lineage_ != scene_->lineage)
    throw input_error("motion", "one of a scene that was compiled apart",
                      "one of this scene or a copy of it");
  revive();
  ArchiveReader in(motion.bytes_, "motion");
  restore_motion(motion.state_, in);
  steps_ = motion.steps_;
  make_watchers();
}

void Simulation::reset(const model::State& state) {
  revive();
  keep_failure([&] { engine_->set_state(state); });
  steps_ = std::lround(state.time / scene_->spec.solver.step);
  report_ = {};
  excitations_.clear();
  make_controller();
  make_watchers();
}

void Simulation::refresh() {
  revive();
  engine_->refresh();
  make_controller();
}

}  // namespace handsim::simulation
