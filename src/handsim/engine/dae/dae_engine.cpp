#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "handsim/engine/checks.h"
#include "handsim/engine/dae/euler.h"
#include "handsim/engine/dae/gear.h"
#include "handsim/engine/dae/penalty.h"
#include "handsim/engine/engine.h"
#include "handsim/engine/multibody/projection.h"
#include "handsim/engine/muscles.h"
#include "handsim/model/angle_sensor.h"
#include "handsim/model/kinematics.h"

namespace handsim::engine::dae {

namespace {

/// Joint gap of a start [m] above which a note reports that the start was moved.
constexpr double kMovedGap = 1e-9;

std::unique_ptr<Integrator> make_integrator(System system, const Settings& settings) {
  switch (settings.dae().method) {
    case DaeMethod::stabilised_gear:
      return make_gear(std::move(system), settings);
    case DaeMethod::lagrange_penalty:
      return make_penalty(std::move(system));
    case DaeMethod::euler_linearised:
    case DaeMethod::euler_projected:
      return make_euler(std::move(system), settings);
  }
  return nullptr;
}

// The differential-algebraic engine: the reference for smooth motion, without contacts and joint stops.
// Maximal coordinates, exact gyroscopic torques; driven and kinematic bodies have prescribed motion. Each
// island (e.g. a finger on a fixed palm) is integrated separately by the method of the settings. set_state is
// a new start: positions and velocities are projected onto the joint constraints (except with
// euler_linearised) and multistep methods start at order one: such a run agrees only within the method's
// error; restore continues with the same bits. The poses of driven bodies follow from their drives.
class DaeEngine final : public Engine {
 public:
  /// The model must outlive the engine. @throws Error (input) also for contact effects, for joint_stops if a
  ///         joint has stops, and for joints that cannot all be closed at the start.
  DaeEngine(const model::Model& model, const Settings& settings)
      : model_(checked(model, settings)),
        settings_(settings),
        drives_(model, settings, {}, {}),
        sensors_(model),
        muscles_(model, settings, [](int a, int b) { return a == b; }),
        drag_(muscles_.empty() ? 0 : static_cast<std::size_t>(model.dof_count())) {
    for (System& island : islands(model, settings)) {
      island.set_drag(drag_);
      islands_.push_back(make_integrator(std::move(island), settings));
    }
    state_ = model::initial_state(model);
    double gap = 0;
    for (const model::Joint& joint : model.joints) gap = std::max(gap, model::joint_gap(joint, state_));
    try {
      reset(state_);
    } catch (const Error& error) {
      throw input_error("model", error.what(), "joints that can all be closed at the start");
    }
    require_regular_start(model, settings, state_);
    if (gap > kMovedGap && settings.dae().method != DaeMethod::euler_linearised)
      notes_.push_back(fmt::format("the start was moved to close a joint gap of {:g} m", gap));
  }

  StepReport step(const StepInput& input) override {
    if (failure_) throw Error(*failure_);
    if (!input.servos.empty())
      throw input_error("servos", "servo drives on the dae engine",
                        "torques (form: explicit), or the ode engine");
    if (auto fault = input_fault(model_, settings_, state_.time, input)) fail(Error(std::move(*fault)));
    std::span<const double> torques = input.torques;
    if (!muscles_.empty()) {
      muscles_.begin_step(state_.q, state_.u, input.excitations);
      muscles_.by_coordinate(state_.u, torques, torques_, drag_);
      torques = torques_;
    }
    const double end = next_time(state_.time, settings_.step);
    model::State next = state_;
    try {
      for (const auto& island : islands_) island->advance(torques, end, next);
      next.time = end;
      drives_.place_driven(end, model::KeySide::before, next);
      check_bodies(next);
      sensors_.read(next);
      set_joint_torques(torques, next);
      if (!muscles_.empty()) muscles_.store_state(next.q, next.u, next);
    } catch (const Error& error) {
      fail(error);
    }
    state_ = std::move(next);
    return {};
  }

  const model::State& state() const override { return state_; }

  void set_state(const model::State& state) override {
    if (failure_) throw Error(*failure_);
    require_state(model_, state);
    try {
      reset(state);
    } catch (const Error& error) {
      // Return to the state before the call.
      reset(model::State(state_));
      throw input_error("state", error.what(), "joints that can all be closed");
    }
  }

  void save(ArchiveWriter& out) const override {
    if (failure_) throw Error(*failure_);
    for (const auto& island : islands_) island->save(out);
  }

  /// Continues with the same bits. For that, stabilised_gear repeats its integration since the last change of
  /// torques or of the chosen constraint rows, which takes as long as the first time.
  void restore(const model::State& state, ArchiveReader& in) override {
    if (failure_) throw Error(*failure_);
    require_state(model_, state);
    for (const auto& island : islands_) island->restore(state, in);
    state_ = state;
    muscles_.reset(state_);
    sensors_.read(state_);
  }

  std::span<const Contact> contacts() const override { return {}; }
  const Settings& settings() const override { return settings_; }
  bool tests_contacts() const override { return false; }
  std::string version() const override {
    return fmt::format("dae ({}, Eigen {}.{}.{})", gear_library(), EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION,
                       EIGEN_MINOR_VERSION);
  }
  std::vector<std::string> notes() const override { return notes_; }

 private:
  /// Starts from a state, projected onto the joints. Kinematic bodies without a drive get zero velocity.
  void reset(const model::State& state) {
    model::State next = state;
    for (std::size_t i = 0; i < next.bodies.size(); ++i)
      if (model_.bodies[i].kinematic) next.bodies[i].v = next.bodies[i].w = Vec3::Zero();
    drives_.place_driven(next.time, model::KeySide::after, next);
    for (const auto& island : islands_) island->reset(next);
    sensors_.read(next);
    muscles_.reset(next);
    state_ = std::move(next);
  }

  /// Sets state.tau, given torques and passive tissue, from the coordinates of the state.
  void set_joint_torques(std::span<const double> given, model::State& state) const {
    state.tau.assign(state.q.size(), 0);
    std::ranges::copy(given, state.tau.begin());
    for (std::size_t i = 0; i < drag_.size(); ++i) state.tau[i] -= drag_[i] * state.u[i];
    if (!settings_.effects.has(model::Effect::passive_tissue)) return;
    for (const model::Joint& joint : model_.joints)
      for (std::size_t k = 0; k < joint.axes.size(); ++k) {
        const auto i = static_cast<std::size_t>(joint.first_dof) + k;
        if (const auto& tissue = joint.axes[k].tissue)
          state.tau[i] -= tissue->stiffness * (state.q[i] - tissue->rest) + tissue->damping * state.u[i];
      }
  }

  void check_bodies(const model::State& state) const {
    for (std::size_t i = 0; i < state.bodies.size(); ++i) {
      // NaN fails these conditions.
      const model::BodyState& body = state.bodies[i];
      const bool slow = body.v.norm() <= kMaxSpeed;
      if (slow && body.w.norm() <= kMaxAngularSpeed && body.p.allFinite() && body.q.coeffs().allFinite())
        continue;
      throw Error(PhysicsFault{
          state.time, model_.bodies[i].name, slow ? "angular speed [rad/s]" : "speed [m/s]",
          fmt::format("{:g} is beyond {:g}: use a smaller step or weaker torques",
                      slow ? body.w.norm() : body.v.norm(), slow ? kMaxAngularSpeed : kMaxSpeed)});
    }
  }

  [[noreturn]] void fail(const Error& error) {
    failure_.emplace(error);
    throw Error(error);
  }

  const model::Model& model_;
  Settings settings_;
  System drives_;  ///< an island without bodies: only moves the driven bodies
  std::vector<std::unique_ptr<Integrator>> islands_;
  std::vector<std::string> notes_;
  model::JointSensors sensors_;
  Muscles muscles_;
  std::vector<double> torques_, drag_;  ///< with tendons in effect: of the step, and their damping
  model::State state_;
  std::optional<Error> failure_;
};

}  // namespace

std::unique_ptr<Engine> make(const model::Model& model, const Settings& settings) {
  return std::make_unique<DaeEngine>(model, settings);
}

}  // namespace handsim::engine::dae
