#include "handsim/engine/articulated/articulated_engine.h"

#include <algorithm>
#include <chrono>

#include <fmt/format.h>

#include "handsim/engine/checks.h"
#include "handsim/engine/collision/ode_library.h"
#include "handsim/engine/multibody/projection.h"
#include "handsim/model/kinematics.h"

namespace handsim::engine::articulated {

namespace {

/// Corrections of stops and torque limits all at once, before they are made one by one, the first that is
/// wrong first (Murty 1974: such a sequence ends), and how many of these.
constexpr int kJointCorrections = 8, kSingleCorrections = 200;
/// A start whose loops are further apart than this is said to have been moved, beyond kOpen refused [m].
constexpr double kMovedGap = 1e-9;

bool smooth(const Settings& settings) {
  return settings.articulated().method != ArticulatedMethod::semi_implicit_euler;
}

bool same_motion(const model::State& a, const model::State& b) {
  const auto same = [](const model::BodyState& x, const model::BodyState& y) {
    return x.p == y.p && x.q.coeffs() == y.q.coeffs() && x.v == y.v && x.w == y.w;
  };
  return std::equal(a.bodies.begin(), a.bodies.end(), b.bodies.begin(), b.bodies.end(), same) &&
         a.tau == b.tau && a.tau_servo == b.tau_servo;
}

}  // namespace

ArticulatedEngine::ArticulatedEngine(const model::Model& model, const Settings& settings,
                                     const Kernel* kernel)
    : model_(checked(model, settings)),
      settings_(settings),
      mechanism_(model, settings, kernel),
      momentum_(mechanism_) {
  for (const Cut& cut : mechanism_.topology().cuts)
    for (const model::JointAxis& axis : model.joints[as_index(cut.joint)].axes)
      if ((axis.stop && settings.effects.has(model::Effect::joint_stops)) ||
          (axis.tissue && settings.effects.has(model::Effect::passive_tissue)))
        throw input_error(model.joints[as_index(cut.joint)].name, "a stop or tissue on every joint of a loop",
                          "one joint of each loop without");
  if (!mechanism_.topology().cuts.empty()) loops_ = std::make_unique<Loops>(model, mechanism_);
  muscles_ = std::make_unique<MuscleCoupling>(model, settings, mechanism_);
  if (muscles_->empty()) muscles_.reset();
  if (muscles_ && loops_)
    throw input_error("effects", "muscles or tendon_coupling beside closed loops",
                      "engine ode, or a scene without loops");
  if (needs_contacts(model, settings.effects)) {
    try {
      contact_ = std::make_unique<ContactDynamics>(model, settings, mechanism_, loops_.get());
      contact_->couple(muscles_.get());
    } catch (const OdeFault& fault) {
      throw input_error("model", "ODE: " + fault.message, "a model that ODE accepts");
    }
  }
  if (smooth(settings))
    smooth_ = std::make_unique<Smooth>(model, settings, mechanism_, loops_.get());
  else
    fast_spin_ = std::make_unique<FastSpin>(model, mechanism_, settings.effects.has(model::Effect::muscles));
  saved_.resize(mechanism_.q().size() + mechanism_.u().size() + mechanism_.torques().size());
  saved_bases_.reserve(drives().size());
  targets_.resize(drives().size());
  ways_.reserve(drives().size());
  state_ = model::initial_state(model);
  double gap = 0;
  for (const model::Joint& joint : model.joints) gap = std::max(gap, model::joint_gap(joint, state_));
  reset(state_);
  if (loops_) require_regular_start(model, settings, state());
  if (gap > kMovedGap)
    notes_.push_back(fmt::format("the start was moved to close a joint gap of {:g} m", gap));
}

void ArticulatedEngine::reset(const model::State& state) {
  model::State next = state;
  // What no drive moves among kinematic bodies stands still.
  std::vector<bool> driven(model_.bodies.size(), false);
  for (const model::Drive& drive : drives()) driven[as_index(drive.body)] = true;
  for (std::size_t i = 0; i < next.bodies.size(); ++i)
    if (model_.bodies[i].kinematic && !driven[i]) next.bodies[i].v = next.bodies[i].w = Vec3::Zero();
  mechanism_.load_state(next);
  mechanism_.forget_limits();
  if (muscles_) muscles_->reset(next);
  if (contact_) {
    contact_->forget();
    contact_->load_state(next);
  }
  if (fast_spin_) fast_spin_->forget();
  if (smooth_) smooth_->set_size(0);
  mechanism_.kernel().kinematics(mechanism_.tree());
  if (loops_ && !(loops_->close() < kOpen))
    throw input_error("state", "loops that are open", "joints that can all be closed");
  time_ = next.time;
  state_ = std::move(next);
  write_state();
  phase_.store(Phase::stated, std::memory_order_relaxed);
}

/// All of state_ but the muscles' part, which is as it was handed over until there is a step.
void ArticulatedEngine::write_state() const {
  write_bodies();
  mechanism_.store_coordinates(state_);
  state_.time = time_;
}

const model::State& ArticulatedEngine::state() const {
  if (phase_.load(std::memory_order_acquire) == Phase::stated) return state_;
  const std::lock_guard lock(writing_);
  if (phase_.load(std::memory_order_relaxed) == Phase::stated) return state_;
  write_state();
  if (muscles_) muscles_->store_state(state_);
  phase_.store(Phase::stated, std::memory_order_release);
  return state_;
}

void ArticulatedEngine::set_state(const model::State& state) {
  if (failure_) throw Error(*failure_);
  require_state(model_, state);
  const model::State before = this->state();
  try {
    reset(state);
  } catch (const Error&) {
    // Nothing is taken over.
    reset(before);
    throw;
  }
}

void ArticulatedEngine::save(ArchiveWriter& out) const {
  if (failure_) throw Error(*failure_);
  mechanism_.save(out);
  out(smooth_ ? smooth_->size() : 0.0, contact_ != nullptr);
  if (contact_) contact_->save(out);
  if (fast_spin_) fast_spin_->save(out);
}

void ArticulatedEngine::restore(const model::State& state, ArchiveReader& in) {
  if (failure_) throw Error(*failure_);
  require_state(model_, state);
  mechanism_.restore(in);
  mechanism_.load_torques(state);
  double size = 0;
  in(size);
  if (!(size >= 0)) in.refuse(fmt::format("a step of {:g} s", size), "0 or more");
  if (smooth_) smooth_->set_size(size);
  bool with_contacts = false;
  in(with_contacts);
  if (with_contacts != (contact_ != nullptr)) in.refuse("contacts of another scene", "those of this one");
  if (contact_) {
    contact_->restore(in);
    contact_->load_state(state);
  }
  if (fast_spin_) fast_spin_->restore(in);
  mechanism_.kernel().kinematics(mechanism_.tree());
  if (muscles_) muscles_->reset(state);
  time_ = state.time;
  state_ = state;
  write_state();
  phase_.store(Phase::stated, std::memory_order_relaxed);
  // Coordinates say where the bodies are: what is said twice has to agree.
  if (!same_motion(state, state_))
    in.refuse("bodies that are not where the joints are", "a state that agrees");
}

/// Before anything moves.
void ArticulatedEngine::check_input(const StepInput& input) {
  if (auto fault = input_fault(model_, settings_, time_, input)) {
    failure_.emplace(std::move(*fault));
    throw Error(*failure_);
  }
  if (input.torques.empty()) return;
  for (const Cut& cut : mechanism_.topology().cuts) {
    const model::Joint& joint = model_.joints[as_index(cut.joint)];
    for (int k = 0; k < dof_count(joint.kind); ++k)
      if (input.torques[as_index(joint.first_dof + k)] != 0)
        throw input_error("torques." + joint.name, "a torque on the joint that the loop is cut at",
                          "a torque on another joint of the loop");
  }
}

void ArticulatedEngine::accept(const StepInput& input) {
  mechanism_.set_torques(muscles_ ? muscles_->begin_step(input) : input.torques);
  mechanism_.set_servos(input.servos, smooth_ ? std::nullopt : std::optional(settings_.step));
}

/// Accelerations of a step with stops and torque limits that agree. Returns 1 where none were found.
int ArticulatedEngine::solve_step() {
  const Kernel& kernel = mechanism_.kernel();
  const LaneTree& tree = mechanism_.tree();
  const double h = settings_.step;
  for (int i = 0; i < kJointCorrections && !loops_ && !muscles_; ++i)
    if (kernel.accelerate(tree, h)) return 0;
  for (int i = loops_ || muscles_ ? 0 : kJointCorrections; i < kJointCorrections + kSingleCorrections; ++i) {
    kernel.prepare(tree, h);
    if (loops_)
      loops_->solve(h);
    else
      kernel.solve(tree);
    if (muscles_) muscles_->correct(h);
    if (kernel.update_active_set(tree, h, i >= kJointCorrections)) return 0;
  }
  return 1;
}

void ArticulatedEngine::collide(StepReport& report) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start = Clock::now();
  // Coordinates are written when somebody asks for the state, which this step leaves behind.
  if (phase_.load(std::memory_order_relaxed) == Phase::stepped) write_bodies();
  try {
    report.collide_calls =
        contact_->collide(state_, {settings_.step, settings_.step * mechanism_.gravity(), ways_});
  } catch (const OdeFault& fault) {
    throw Error(PhysicsFault{time_, "the model", "ODE", fault.message});
  }
  report.contacts = static_cast<int>(contact_->contacts().size());
  report.collide_ns = std::chrono::duration<double, std::nano>(Clock::now() - start).count();
}

/// Where a step ends: poses, and rates that go with them. False where the motion is not sound.
bool ArticulatedEngine::correct_end(bool fast) {
  bool sound = momentum_.correct(mechanism_.kernel().kinematics(mechanism_.tree()));
  // Rates beyond all bounds may come back within them.
  if (fast) {
    if (derive_) uncorrected_.assign(mechanism_.u().begin(), mechanism_.u().end());
    sound = fast_spin_->correct(sound);
    if (derive_ && !std::ranges::equal(uncorrected_, mechanism_.u()))
      derive_->notes.emplace_back("fast rotation: rates were corrected, derivatives are those before");
  }
  if (!loops_) return sound;
  return sound && loops_->close() < kOpen && momentum_.correct(sound);
}

void ArticulatedEngine::step_implicitly(const StepInput& input, double end, StepReport& report) {
  const Kernel& kernel = mechanism_.kernel();
  const LaneTree& tree = mechanism_.tree();
  compute_targets(input.drive_targets, end);
  if (contact_) collide(report);
  const bool fast = fast_spin_->begin_step(input, settings_.step);
  const bool moving = set_base_velocities();
  mechanism_.update_gyroscopic_torques(settings_.step);
  if (!input.forces.empty()) mechanism_.add_forces(input.forces);
  if (report.contacts > 0) {
    const NewtonReport found = contact_->solve(settings_.step);
    report.contact_sweeps = found.iterations;
    report.limit_updates = found.limit_updates;
    report.contact_residual = found.residual;
    report.iterative = found.iterative;
    report.lcp_failures = found.solved ? 0 : 1;
  } else {
    if (contact_) contact_->recover(settings_.step);
    report.lcp_failures = solve_step();
  }
  if (derive_) compute_derivatives(input, report);
  momentum_.begin_step(input.forces, report.contacts > 0 ? contact_.get() : nullptr, settings_.step, false);
  if (derive_ && momentum_.active())
    derive_->notes.emplace_back(
        "objects that touch only each other: without the correction of their momentum");
  if (!fast && !moving && !loops_) {
    const bool sound = momentum_.correct(kernel.advance(tree, settings_.step));
    if (muscles_) muscles_->correct_torques(settings_.step);
    return check(sound, end);
  }
  kernel.compute_torques(tree, settings_.step);
  if (muscles_) muscles_->correct_torques(settings_.step);
  if (fast) fast_spin_->add_work(report.contacts > 0 || loops_);
  kernel.integrate(tree, settings_.step);
  if (moving) place_bases();
  check(correct_end(fast), end);
}

void ArticulatedEngine::refresh() {
  if (failure_) throw Error(*failure_);
  mechanism_.refresh(settings_);
  momentum_.refresh();
  if (contact_) contact_->refresh();
  if (fast_spin_) fast_spin_->refresh();
  mechanism_.kernel().kinematics(mechanism_.tree());
}

std::span<const Contact> ArticulatedEngine::contacts() const {
  return contact_ ? contact_->contacts() : std::span<const Contact>();
}

StepReport ArticulatedEngine::step(const StepInput& input) {
  if (failure_) throw Error(*failure_);
  check_input(input);
  if (derive_) begin_derivatives();
  // Contacts are found at the state, whose tensions `accept` replaces by those of the step.
  if (muscles_ && contact_) state();
  save_start();
  try {
    return make_step(input);
  } catch (const Error& error) {
    restore_start();
    if (error.fault())
      failure_.emplace(error);
    else
      undo_derivatives();
    throw;
  } catch (...) {
    restore_start();
    throw;
  }
}

StepReport ArticulatedEngine::make_step(const StepInput& input) {
  accept(input);
  const double end = next_time(time_, settings_.step);
  StepReport report;
  if (smooth_) {
    momentum_.begin_step({}, nullptr, end - time_, true);
    check(momentum_.correct(smooth_->advance(time_, end)), end);
  } else {
    step_implicitly(input, end, report);
  }
  if (settings_.effects.has(model::Effect::joint_stops)) report.stop_rows = mechanism_.stops_in_force();
  time_ = end;
  phase_.store(Phase::stepped, std::memory_order_relaxed);
  return report;
}

void ArticulatedEngine::check(bool sound, double time) const {
  if (sound) return;
  model::State bad = state_;
  mechanism_.store_state(bad);
  PhysicsFault fault{time, "the model", "motion",
                     loops_ ? "a loop cannot be held closed, or the motion is not smooth: use a smaller step"
                            : "too fast or not smooth enough to go on: use a smaller step or weaker torques"};
  for (std::size_t i = 1; i < bad.bodies.size(); ++i) {
    if (model_.bodies[i].kinematic) continue;
    const model::BodyState& body = bad.bodies[i];
    // Written so that NaN fails.
    const bool slow = body.v.norm() <= kMaxSpeed;
    if (slow && body.w.norm() <= kMaxAngularSpeed) continue;
    fault.where = model_.bodies[i].name;
    fault.quantity = slow ? "angular speed [rad/s]" : "speed [m/s]";
    fault.detail = fmt::format("{:g} is beyond {:g}: use a smaller step, or weaker gains or torques",
                               slow ? body.w.norm() : body.v.norm(), slow ? kMaxAngularSpeed : kMaxSpeed);
    break;
  }
  throw Error(std::move(fault));
}

void ArticulatedEngine::save_start() {
  auto to = saved_.begin();
  for (const std::span<double> kept : {mechanism_.q(), mechanism_.u(), mechanism_.torques()})
    to = std::ranges::copy(kept, to).out;
  saved_bases_.clear();
  for (const model::Drive& drive : drives()) saved_bases_.push_back(mechanism_.base(drive.body));
}

/// Back to before the step: state() is the last good one.
void ArticulatedEngine::restore_start() {
  auto from = saved_.begin();
  for (const std::span<double> kept : {mechanism_.q(), mechanism_.u(), mechanism_.torques()}) {
    std::copy_n(from, kept.size(), kept.begin());
    from += static_cast<std::ptrdiff_t>(kept.size());
  }
  for (std::size_t i = 0; i < drives().size(); ++i) mechanism_.base(drives()[i].body) = saved_bases_[i];
  mechanism_.update_bases();
  mechanism_.kernel().kinematics(mechanism_.tree());
  if (contact_) contact_->load_state(state_);
  if (muscles_) muscles_->restore_step();
}

std::string ArticulatedEngine::version() const {
  return fmt::format("articulated, {}", mechanism_.kernel().name);
}

std::unique_ptr<Engine> make(const model::Model& model, const Settings& settings) {
  return std::make_unique<ArticulatedEngine>(model, settings);
}

}  // namespace handsim::engine::articulated
