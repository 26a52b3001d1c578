// One step of the ODE engine: drive, tissue, collide, push, solve, check, read.
#include <chrono>
#include <cmath>

#include <fmt/format.h>

#include "handsim/engine/ode/handlers.h"
#include "handsim/engine/ode/ode_engine.h"

namespace handsim::engine::ode {

namespace {

using Clock = std::chrono::steady_clock;

double ns_since(Clock::time_point start) {
  return std::chrono::duration<double, std::nano>(Clock::now() - start).count();
}

constexpr const char* kRemedy = "use a smaller step, weaker gains or torques, or a start without overlap";

/// Steps are counted from time zero, so that time neither drifts nor depends on where a run was resumed.
long long step_number(double time, double step) { return std::llround(time / step); }

double next_time(double time, double step) {
  const auto n = static_cast<double>(step_number(time, step));
  return std::abs(time - n * step) <= 1e-6 * step ? (n + 1) * step : time + step;
}

/// Seed of one step (splitmix64, Steele, Lea & Flood 2014): a function of the run's seed and the step's
/// number, so that a saved state needs no generator state beside it.
std::uint64_t step_seed(std::uint64_t seed, long long number) {
  std::uint64_t z = seed + 0x9e3779b97f4a7c15ULL * (static_cast<std::uint64_t>(number) + 1);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return (z ^ (z >> 31)) & 0xffffffffULL;
}

double squared_norm(const double* v) { return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; }

}  // namespace

StepReport OdeEngine::step(const StepInput& input) {
  if (failure_) throw Error(*failure_);
  enter_ode();
  const double end = next_time(state_.time, settings_.step);
  StepReport report;
  try {
    if (drives_) drives_->aim(end, settings_.step);
    prepare(input, report);
    const int failures = lcp_failures();
    advance();
    report.lcp_failures = lcp_failures() - failures;
    if (contacts_) contacts_->release();
  } catch (const OdeFault& fault) {
    fail(fault);
  }
  check_bodies(end);
  read(end);
  return report;
}

void OdeEngine::prepare(const StepInput& input, StepReport& report) {
  if (settings_.effects.has(model::Effect::actuation)) {
    const Clock::time_point start = Clock::now();
    actuate(input);
    report.servo_ns = ns_since(start);
  } else {
    actuate(input);
  }
  if (joints_->has_tissue()) {
    const Clock::time_point start = Clock::now();
    report.stop_rows = joints_->prepare(state_);
    report.tissue_ns = ns_since(start);
  } else {
    report.stop_rows = joints_->prepare(state_);
  }
  if (contacts_) {
    const Clock::time_point start = Clock::now();
    report.collide_calls = contacts_->collide(state_);
    report.contacts = static_cast<int>(contacts_->list().size());
    report.collide_ns = ns_since(start);
  }
}

void OdeEngine::actuate(const StepInput& input) {
  if (!input.torques.empty()) {
    check_torques(input.torques);
    joints_->add_torques(input.torques, state_);
  }
  if (!input.servos.empty()) check_servos(input.servos);
  joints_->set_servos(input.servos);
}

void OdeEngine::check_servos(std::span<const model::Servo> servos) {
  if (!settings_.effects.has(model::Effect::actuation))
    throw input_error("servos", "servos without the actuation effect", "actuation among the effects");
  if (servos.size() != static_cast<std::size_t>(model_.dof_count()))
    throw input_error("servos", fmt::format("{}", servos.size()),
                      fmt::format("one for each of {} coordinates", model_.dof_count()));
  for (const model::Joint& joint : model_.joints)
    for (int i = 0; i < dof_count(joint.kind); ++i) {
      const model::Servo& servo = servos[static_cast<std::size_t>(joint.first_dof + i)];
      if (servo.limit == 0) continue;
      if (!std::isfinite(servo.error + servo.feed))
        fail(PhysicsFault{
            state_.time, joint.name, "servo",
            fmt::format("coordinate {} has an error of {} and a feed of {}, not finite numbers: check "
                        "the controller",
                        i, servo.error, servo.feed)});
      // Written so that NaN fails.
      const bool sound = servo.stiffness >= 0 && servo.damping >= 0 && servo.limit > 0 &&
                         servo.stiffness + servo.damping > 0 &&
                         std::isfinite(servo.stiffness + servo.damping);
      if (!sound || joint.axes.empty())
        throw input_error(
            "servos." + joint.name,
            fmt::format("stiffness {:g}, damping {:g}, limit {:g}", servo.stiffness, servo.damping,
                        servo.limit),
            "a hinge, universal or slider with gains of 0 or more, not both 0, and a limit of 0 or more");
    }
}

void OdeEngine::check_torques(std::span<const double> torques) {
  if (torques.size() != static_cast<std::size_t>(model_.dof_count()))
    throw input_error("torques", fmt::format("{}", torques.size()),
                      fmt::format("one for each of {} coordinates", model_.dof_count()));
  for (const model::Joint& joint : model_.joints)
    for (int i = 0; i < dof_count(joint.kind); ++i) {
      const double torque = torques[static_cast<std::size_t>(joint.first_dof + i)];
      if (std::isfinite(torque)) continue;
      fail(PhysicsFault{
          state_.time, joint.name, "joint torque [N m]",
          fmt::format("coordinate {} has {}, not a finite number: check the controller", i, torque)});
    }
}

void OdeEngine::advance() {
  const dWorldID world = ids_.world.get();
  switch (settings_.method) {
    case Method::world_step:
      dWorldStep(world, settings_.step);
      return;
    case Method::quick_step: {
      const RandomSeed seed(step_seed(settings_.seed, step_number(state_.time, settings_.step)));
      dWorldQuickStep(world, settings_.step);
      return;
    }
  }
}

void OdeEngine::check_bodies(double time) {
  for (const std::size_t i : moving_) {
    const OdeBody& body = bodies_[i];
    // Written so that NaN fails. A finite velocity within bounds leaves position and rotation finite.
    const bool slow = squared_norm(body.v) <= kMaxSpeed * kMaxSpeed;
    const bool calm = squared_norm(body.w) <= kMaxAngularSpeed * kMaxAngularSpeed;
    if (slow && calm && std::isfinite(body.q[0])) continue;
    const double found = std::sqrt(squared_norm(slow ? body.w : body.v));
    fail(PhysicsFault{
        time, model_.bodies[i].name, slow ? "angular speed [rad/s]" : "speed [m/s]",
        fmt::format("{:g} is beyond {:g}: {}", found, slow ? kMaxAngularSpeed : kMaxSpeed, kRemedy)});
  }
}

void OdeEngine::read(double time) {
  for (const std::size_t i : moving_) state_.bodies[i] = read_state(bodies_[i]);
  state_.time = time;
}

void OdeEngine::fail(PhysicsFault fault) {
  failure_.emplace(std::move(fault));
  throw Error(*failure_);
}

void OdeEngine::fail(const OdeFault& fault) {
  // The body that went wrong first, where ODE stopped before telling.
  check_bodies(state_.time + settings_.step);
  fail(PhysicsFault{state_.time + settings_.step, "the model", "ODE stopped",
                    fmt::format("{}: {}", fault.message, kRemedy)});
}

}  // namespace handsim::engine::ode
