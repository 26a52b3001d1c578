// One step of the ODE engine: drive, tissue, collide, push, solve, check, read.
#include <chrono>
#include <cmath>
#include <new>
#include <utility>

#include <fmt/format.h>

#include "handsim/engine/checks.h"
#include "handsim/engine/multibody/projection.h"
#include "handsim/engine/ode/ode_engine.h"
#include "handsim/engine/ode/world_resources.h"

namespace handsim::engine::ode {

namespace {

using Clock = std::chrono::steady_clock;

/// Adds the time that a part of the step takes [ns]. @param ns null: is not asked for
template <class Part>
void timed(double* ns, Part part) {
  if (ns == nullptr) return part();
  const Clock::time_point start = Clock::now();
  part();
  *ns += std::chrono::duration<double, std::nano>(Clock::now() - start).count();
}

constexpr const char* kRemedy = "use a smaller step, weaker gains or torques, or a start without overlap";

/// Solutions of a step that may be thrown away because pads do not do what they were taken to do: so many
/// whose guesses are mended (Newton's method on Coulomb's law), then, from the first guesses, as many more as
/// this with limits where they were wrong. A solution without limits is a tenth of the work of one in which
/// all contacts have them.
constexpr int kMended = 8, kThrownAway = kMended + 3;

/// Seed of one step (splitmix64, Steele, Lea & Flood 2014) of run's seed and step number: no state to save.
std::uint64_t step_seed(std::uint64_t seed, long long number) {
  std::uint64_t z = seed + 0x9e3779b97f4a7c15ULL * (static_cast<std::uint64_t>(number) + 1);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return (z ^ (z >> 31)) & 0xffffffffULL;
}

PhysicsFault no_memory(double time, bool iterative) {
  constexpr double kMega = 1e-6;
  const RefusedMemory memory = refused_memory();
  return {time, "the solver", "memory",
          fmt::format("this step of {} needs {:.0f} MB, and {:.0f} MB are free: {}",
                      iterative ? "quick_step" : "world_step", kMega * static_cast<double>(memory.needed),
                      kMega * static_cast<double>(memory.free),
                      iterative ? "use fewer bodies or contacts"
                                : "use solver.method quick_step, or fewer bodies that touch")};
}

double squared_norm(const double* v) { return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; }

}  // namespace

/// The step's torques with those of tendons, and the tendons' damping in the joints' rows.
StepInput OdeEngine::with_tendons(const StepInput& given) {
  if (muscles_->empty()) return given;
  muscles_->begin_step(state_.q, state_.u, given.excitations);
  muscles_->by_coordinate(state_.u, given.torques, torques_, drag_);
  joints_->set_drag(drag_);
  // The joints' rows have the part of the rates at the start.
  for (std::size_t i = 0; i < torques_.size(); ++i) torques_[i] -= drag_[i] * state_.u[i];
  StepInput out = given;
  out.torques = torques_;
  return out;
}

StepReport OdeEngine::step(const StepInput& given) {
  if (failure_) throw Error(*failure_);
  if (auto fault = input_fault(model_, settings_, state_.time, given)) fail(std::move(*fault));
  const StepInput input = with_tendons(given);
  enter_ode();
  const double end = next_time(state_.time, settings_.step);
  try {
    const StepReport report = make_step(input, end);
    if (auto fault = body_fault(end)) fail(std::move(*fault));
    if (auto fault = read_bodies(end)) fail(std::move(*fault));
    if (!muscles_->empty()) muscles_->store_state(state_.q, state_.u, state_);
    if (contacts_) contacts_->store_state(state_);
    return report;
  } catch (const OdeFault& fault) {
    fail(fault);
  }
}

StepReport OdeEngine::make_step(const StepInput& input, double end) {
  const double step = settings_.step;
  StepReport report;
  report.iterative = settings_.ode().method == OdeMethod::quick_step;
  if (settings_.effects.has(model::Effect::wrist_motion)) {
    const bool given = !input.drive_targets.empty();
    std::vector<Pose> targets(input.drive_targets.begin(), input.drive_targets.end());
    for (const model::Drive& each : model_.drives)
      if (!given) targets.push_back(each.motion.at(end));
    ways_ = drive(model_, bodies_, targets, given ? end - (end - step) : step, step);
  }
  try {
    prepare(input, report);
    if (contacts_) contacts_->recall(state_);
    solve(input, report);
  } catch (const std::bad_alloc&) {
    throw OdeFault{kNoMemory, "out of memory"};
  }
  if (residual_is_due(report)) report.residual = residual_.measure(state_, bodies_, step, contacts_.get());
  if (contacts_) {
    contacts_->update_memory(state_);
    contacts_->release();
  }
  return report;
}

/// Makes the direct solver's step again where friction's limits are of other normal forces, or something
/// without a limit passes its own. Pads are taken to stick or to slide as they did, as most of a held
/// object's do; one that then does not costs a solution that is thrown away.
void OdeEngine::solve(const StepInput& input, StepReport& report) {
  const bool again = contacts_ != nullptr && !report.iterative && !contacts_->list().empty();
  const int passes = again ? settings_.ode().friction_passes : 1;
  start_.clear();
  for (const std::size_t i : moving_)
    if (again) start_.push_back(step_start(bodies_[i]));
  const auto back = [&] {
    contacts_->release();
    for (std::size_t k = 0; k < moving_.size(); ++k) put_back(bodies_[moving_[k]], start_[k]);
  };
  if (contacts_) contacts_->guess(state_);
  bool rigid_limits = true;
  int thrown_away = 0;
  for (int pass = 1;;) {
    // The last solution has all limits.
    const bool relaxed = pass < passes;
    if (contacts_ && (!relaxed || thrown_away == kThrownAway)) contacts_->guess_nothing();
    joints_->relax_servos(relaxed && !input.servos.empty() ? (pass > 1 ? tau_servo_ : state_.tau_servo)
                                                           : std::span<const double>());
    if (contacts_) timed(&report.collide_ns, [&] { contacts_->join(state_, rigid_limits); });
    const int failures = lcp_failures();
    advance();
    report.lcp_failures = lcp_failures() - failures;
    report.passes = pass;
    joints_->read_torques(input.torques, tau_, tau_servo_);
    if (contacts_) contacts_->read_forces();
    if (!again) return;
    if (contacts_->refutes(state_, thrown_away < kMended)) {
      ++thrown_away;
      back();
      if (thrown_away == kMended) contacts_->guess(state_);
      continue;
    }
    const bool revised = contacts_->update_limits();
    const bool wrong = revised || report.lcp_failures > 0 || joints_->servos_beyond_limits(tau_servo_);
    if (!wrong || (pass >= passes && !(report.lcp_failures > 0 && rigid_limits))) return;
    // The solver that fails with limits of rigid contacts has ODE's own in one more solution.
    if (pass >= passes) rigid_limits = false;
    back();
    ++pass;
  }
}

/// Where something has just met a stop or touches, at other steps now and then. By the step's number, so that
/// a run that goes on from a saved state measures at the same steps.
bool OdeEngine::residual_is_due(const StepReport& report) {
  const bool stops_changed = report.stop_rows != std::exchange(stop_rows_, report.stop_rows);
  if (report.lcp_failures > 0) return true;
  if (!report.iterative) return false;
  return report.contacts > 0 || stops_changed ||
         step_number(state_.time, settings_.step) % kResidualInterval == 0;
}

void OdeEngine::prepare(const StepInput& input, StepReport& report) {
  const bool with_servos = settings_.effects.has(model::Effect::actuation);
  timed(with_servos ? &report.servo_ns : nullptr, [&] { actuate(input); });
  timed(joints_->has_tissue() ? &report.tissue_ns : nullptr,
        [&] { report.stop_rows = joints_->prepare(state_); });
  if (!contacts_) return;
  timed(&report.collide_ns, [&] { report.collide_calls = contacts_->collide(state_, ways_); });
  report.contacts = static_cast<int>(contacts_->list().size());
}

void OdeEngine::actuate(const StepInput& input) {
  if (!input.torques.empty()) joints_->add_torques(input.torques, state_);
  joints_->set_servos(input.servos);
  for (const BodyForce& each : input.forces) {
    const dBodyID id = bodies_[as_index(each.body)].id;
    dBodyAddForce(id, each.force.x(), each.force.y(), each.force.z());
    dBodyAddTorque(id, each.moment.x(), each.moment.y(), each.moment.z());
  }
}

void OdeEngine::advance() {
  const dWorldID world = ids_.world.get();
  const double step = settings_.step;
  const bool iterative = settings_.ode().method == OdeMethod::quick_step;
  bool made = false;
  if (iterative) {
    const RandomSeed seed(step_seed(settings_.ode().seed, step_number(state_.time, step)));
    made = dWorldQuickStep(world, step) != 0;
  } else {
    made = dWorldStep(world, step) != 0;
  }
  if (!made) fail(no_memory(state_.time + step, iterative));
}

std::optional<PhysicsFault> OdeEngine::body_fault(double time) const {
  for (const std::size_t i : moving_) {
    const OdeBody& body = bodies_[i];
    // Written so that NaN fails. A finite velocity within bounds leaves position and rotation finite.
    const bool slow = squared_norm(body.v) <= kMaxSpeed * kMaxSpeed;
    const bool calm = squared_norm(body.w) <= kMaxAngularSpeed * kMaxAngularSpeed;
    if (slow && calm && std::isfinite(body.q[0])) continue;
    const double found = std::sqrt(squared_norm(slow ? body.w : body.v));
    return PhysicsFault{
        time, model_.bodies[i].name, slow ? "angular speed [rad/s]" : "speed [m/s]",
        fmt::format("{:g} is beyond {:g}: {}", found, slow ? kMaxAngularSpeed : kMaxSpeed, kRemedy)};
  }
  return std::nullopt;
}

/// Takes ODE's state over, projected if asked for and given back. @return a joint still apart: not taken
std::optional<PhysicsFault> OdeEngine::read_bodies(double time) {
  if (!closed_.empty()) opened_ = state_;
  for (const std::size_t i : moving_) state_.bodies[i] = read_state(bodies_[i]);
  state_.tau.swap(tau_);
  state_.tau_servo.swap(tau_servo_);
  state_.time = time;
  try {
    for (const System& island : closed_) close_step(island, opened_, time - opened_.time, state_);
  } catch (const Error& error) {
    state_ = opened_;
    return error.fault();
  }
  for (const std::size_t i : moving_)
    if (!closed_.empty() && !bodies_[i].driven) write_state(bodies_[i], state_.bodies[i]);
  joints_->read_coordinates(state_);
  return std::nullopt;
}

void OdeEngine::fail(PhysicsFault fault) {
  failure_.emplace(std::move(fault));
  throw Error(*failure_);
}

PhysicsFault OdeEngine::described(const OdeFault& fault) const {
  const double time = state_.time + settings_.step;
  // The body that went wrong first, where ODE stopped before telling.
  if (auto body = body_fault(time)) return *body;
  if (fault.number == kNoMemory)
    return {time, "the model", "memory", "ODE did not get what it asked for: use fewer bodies that touch"};
  return {time, "the model", "ODE stopped", fmt::format("{}: {}", fault.message, kRemedy)};
}

void OdeEngine::fail(const OdeFault& fault) {
  PhysicsFault told = described(fault);
  give_up_step();
  fail(std::move(told));
}

/// After ODE stopped in the middle of a step: the world can be destroyed, its threading cannot.
void OdeEngine::give_up_step() { abandon(ids_.threading.release()); }

}  // namespace handsim::engine::ode
