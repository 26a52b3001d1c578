#include "handsim/engine/ode/ode_engine.h"

#include <algorithm>

#include <fmt/format.h>

#include "handsim/engine/checks.h"
#include "handsim/engine/multibody/projection.h"
#include "handsim/model/kinematics.h"

namespace handsim::engine::ode {

namespace {

constexpr double kSofter = 100;
constexpr int kGuardIterations = 200;

}  // namespace

OdeEngine::OdeEngine(const model::Model& model, const Settings& settings)
    : model_(checked(model, settings)), settings_(settings), residual_(model, settings.erp()) {
  if (settings.ode().projection) require_regular_start(model, settings, model::initial_state(model));
  enter_ode();
  try {
    build();
  } catch (const OdeFault& fault) {
    throw input_error("model", "ODE: " + fault.message, "a model that ODE accepts");
  }
}

void OdeEngine::set_gravity() {
  const Vec3 gravity = settings_.effects.has(model::Effect::gravity) ? model_.gravity : Vec3::Zero();
  dWorldSetGravity(ids_.world.get(), gravity.x(), gravity.y(), gravity.z());
  if (contacts_) contacts_->set_gravity(gravity);
}

void OdeEngine::build() {
  ids_ = make_world();
  const dWorldID world = ids_.world.get();
  set_gravity();
  dWorldSetERP(world, settings_.ode().erp);
  dWorldSetCFM(world, settings_.ode().cfm);
  dWorldSetQuickStepNumIterations(world, settings_.ode().iterations);
  immovable_ = immovable_bodies(model_, settings_.effects);
  bodies_ = make_bodies(world, model_, immovable_);
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    if (bodies_[i].id != nullptr) moving_.push_back(i);
  state_ = model::initial_state(model_);
  joints_ = std::make_unique<Joints>(world, model_, settings_, bodies_, state_);
  if (!drag_.empty()) joints_->set_drag(drag_);
  if (!muscles_) {
    muscles_ = std::make_unique<Muscles>(model_, settings_, [](int a, int b) { return a == b; });
    muscles_->start(state_);
  }
  if (needs_contacts(model_, settings_.effects))
    contacts_ = std::make_unique<Contacts>(ids_, model_, settings_, bodies_);
  if (settings_.ode().projection) closed_ = islands(model_, settings_);
  if (settings_.ode().method == OdeMethod::automatic)
    choice_ = std::make_unique<MethodChoice>(model_, *joints_, bodies_, settings_);
  write(state_);
  if (contacts_) contacts_->place_immovable(state_);
}

/// Takes a state over into ODE; kinematic bodies that stand still have no velocity, whatever it says.
void OdeEngine::write(const model::State& state) {
  state_ = state;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    if (immovable_[i]) state_.bodies[i].v = state_.bodies[i].w = Vec3::Zero();
    write_state(bodies_[i], state_.bodies[i]);
  }
  joints_->read_coordinates(state_);
}

bool OdeEngine::immovable_moved(const model::State& state) const {
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    if (immovable_[i] && (state.bodies[i].p != state_.bodies[i].p ||
                          state.bodies[i].q.coeffs() != state_.bodies[i].q.coeffs()))
      return true;
  return false;
}

void OdeEngine::set_state(const model::State& state) {
  if (failure_) throw Error(*failure_);
  require_state(model_, state);
  stop_rows_ = 0;
  enter_ode();
  try {
    const bool moved = immovable_moved(state);
    if (moved) joints_->reanchor(state);
    write(state);
    if (contacts_) contacts_->set_memory({});
    if (moved && contacts_) contacts_->place_immovable(state_);
    muscles_->start(state);
  } catch (const OdeFault& fault) {
    fail(fault);
  }
}

void OdeEngine::save(ArchiveWriter& out) const {
  if (failure_) throw Error(*failure_);
  out(stop_rows_, contacts_ != nullptr);
  if (contacts_) contacts_->save(out);
}

void OdeEngine::restore(const model::State& state, ArchiveReader& in) {
  set_state(state);
  in(stop_rows_);
  bool with_contacts = false;
  in(with_contacts);
  if (with_contacts != (contacts_ != nullptr)) in.refuse("contacts of another scene", "those of this one");
  if (contacts_) contacts_->restore(in);
}

void OdeEngine::refresh() {
  if (failure_) throw Error(*failure_);
  set_gravity();
  for (const std::size_t i : moving_)
    if (!model_.bodies[i].kinematic) set_mass(bodies_[i].id, model_.bodies[i]);
}

std::span<const Contact> OdeEngine::contacts() const {
  return contacts_ ? std::span<const Contact>(contacts_->list()) : std::span<const Contact>();
}

std::string OdeEngine::version() const {
  return fmt::format("ODE {} {}", dODE_VERSION, sizeof(dReal) == sizeof(double) ? "double" : "single");
}

std::vector<std::string> OdeEngine::notes() const { return joints_->notes(); }

std::unique_ptr<Engine> make(const model::Model& model, const Settings& settings) {
  return std::make_unique<OdeEngine>(model, settings);
}

StepReport OdeEngine::guarded_step(const StepInput& input, double end) {
  before_ = state_;
  if (contacts_) memory_before_ = contacts_->memory();
  StepReport report;
  std::optional<PhysicsFault> fault;
  for (const Rung rung : {Rung::none, Rung::softer, Rung::half_steps, Rung::quick_step}) {
    if (rung != Rung::none) restore();
    fault = on_rung(rung, input, end, report);
    report.rung = rung;
    if (!fault) return report;
  }
  // A state that another step can start from is better kept and counted than thrown away.
  const auto out = body_fault(end, kMaxSpeed, kMaxAngularSpeed);
  if (state_.time == end && !out) {
    report.rung = Rung::unresolved;
    return report;
  }
  restore();
  fail(std::move(out && state_.time == end ? *out : *fault));
}

/// Tries the step in one way. @return what is wrong with it
std::optional<PhysicsFault> OdeEngine::on_rung(Rung rung, const StepInput& input, double end,
                                               StepReport& report) {
  const OdeSettings& ode = settings_.ode();
  const auto iterate = [&](int count) { dWorldSetQuickStepNumIterations(ids_.world.get(), count); };
  std::optional<PhysicsFault> fault;
  try {
    if (rung == Rung::softer) set_cfm(std::min(kSofter * ode.cfm, 1.0));
    if (rung == Rung::quick_step) iterate(std::max(kGuardIterations, ode.iterations));
    if (rung == Rung::half_steps) {
      fault = two_half_steps(input, end, report);
    } else {
      report = plain_step(input, end, settings_.step,
                          rung == Rung::quick_step ? OdeMethod::quick_step : ode.method);
      fault = read_bodies(end);
    }
    if (!fault) fault = guard_fault(report);
  } catch (const StepRefused& refused) {
    fault = refused.fault;
  } catch (const OdeFault& stopped) {
    fault = described(stopped);
    rebuild();
    return fault;
  }
  if (rung == Rung::none) return fault;
  set_cfm(ode.cfm);
  set_length(settings_.step);
  iterate(ode.iterations);
  return fault;
}

/// Takes over what the bodies have become, unless it is beyond all bounds.
std::optional<PhysicsFault> OdeEngine::read_bodies(double time) {
  if (auto fault = body_fault(time, kMaxSpeed, kMaxAngularSpeed)) return fault;
  return take_over(time);
}

std::optional<PhysicsFault> OdeEngine::two_half_steps(const StepInput& input, double end,
                                                      StepReport& report) {
  const double half = 0.5 * settings_.step;
  const double middle = before_.time + half;
  set_length(half);
  const StepReport first = plain_step(input, middle, half, settings_.ode().method);
  if (auto fault = read_bodies(middle)) return fault;
  StepInput second = input;
  if (!input.servos.empty()) {
    // A servo's error is the one at the start of its step.
    second_servos_.assign(input.servos.begin(), input.servos.end());
    for (std::size_t i = 0; i < second_servos_.size(); ++i)
      second_servos_[i].error -= state_.q[i] - before_.q[i];
    second.servos = second_servos_;
  }
  report = plain_step(second, end, half, settings_.ode().method);
  report.lcp_failures += first.lcp_failures;
  if (!report.residual) report.residual = first.residual;
  report.collide_calls += first.collide_calls;
  report.collide_ns += first.collide_ns;
  report.tissue_ns += first.tissue_ns;
  report.servo_ns += first.servo_ns;
  // Torques of the whole step: the mean of its halves.
  for (std::size_t i = 0; i < tau_.size(); ++i) {
    tau_[i] = 0.5 * (state_.tau[i] + tau_[i]);
    tau_servo_[i] = 0.5 * (state_.tau_servo[i] + tau_servo_[i]);
  }
  return read_bodies(end);
}

std::optional<PhysicsFault> OdeEngine::guard_fault(const StepReport& report) const {
  const GuardLimits& limits = *settings_.ode().guard;
  if (auto fault = body_fault(state_.time, limits.speed, limits.angular_speed)) return fault;
  if (report.lcp_failures > 0)
    return PhysicsFault{state_.time, "the solver", "LCP failures", fmt::format("{}", report.lcp_failures)};
  for (const model::Joint& joint : model_.joints) {
    const double gap = model::joint_gap(joint, state_);
    if (gap > limits.joint_gap)
      return PhysicsFault{state_.time, joint.name, "joint gap [m]",
                          fmt::format("{:g} is beyond {:g}", gap, limits.joint_gap)};
  }
  return std::nullopt;
}

/// As before a guarded step. A solver that refused the step has left its torques and forces on the bodies.
void OdeEngine::restore() {
  write(before_);
  for (const std::size_t i : moving_) {
    dBodySetForce(bodies_[i].id, 0, 0, 0);
    dBodySetTorque(bodies_[i].id, 0, 0, 0);
  }
  if (contacts_) contacts_->set_memory(memory_before_);
}

/// A world in which ODE stopped half way can only be destroyed.
void OdeEngine::rebuild() {
  choice_.reset();
  contacts_.reset();
  joints_.reset();
  bodies_.clear();
  moving_.clear();
  give_up_step();
  ids_ = {};
  build();
  if (immovable_moved(before_)) joints_->reanchor(before_);
  restore();
  if (contacts_) contacts_->place_immovable(before_);
}

void OdeEngine::set_length(double step) {
  joints_->set_step(step);
  if (contacts_) contacts_->set_step(step);
}

void OdeEngine::set_cfm(double cfm) {
  dWorldSetCFM(ids_.world.get(), cfm);
  joints_->set_stop_cfm(cfm);
}

}  // namespace handsim::engine::ode
