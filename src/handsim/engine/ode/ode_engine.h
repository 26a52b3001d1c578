// The engine on the Open Dynamics Engine: one ODE world, built from the model with the effects asked for and
// nothing else.
// world_step is bit-reproducible in any number of threads. quick_step draws from ODE's one process-wide
// random generator: each step seeds it from (seed, step number) under a process-wide lock, so runs are
// bit-reproducible too, also from a saved state, but quick_step steps of several threads take turns.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/engine/multibody/system.h"
#include "handsim/engine/muscles.h"
#include "handsim/engine/ode/bodies.h"
#include "handsim/engine/ode/contacts.h"
#include "handsim/engine/ode/joints.h"
#include "handsim/engine/ode/residual.h"

namespace handsim::engine::ode {

class OdeEngine final : public Engine {
 public:
  /// @throws Error (input); the model must outlive the engine.
  OdeEngine(const model::Model& model, const Settings& settings);

  StepReport step(const StepInput& input) override;
  const model::State& state() const override { return state_; }
  /// Bit-exact, but for friction: what has crept, and the contacts' last forces, are forgotten.
  void set_state(const model::State& state) override;
  /// The contacts, their creep and forces and the stops in force of the last step: all else is in the state.
  void save(ArchiveWriter& out) const override;
  void restore(const model::State& state, ArchiveReader& in) override;
  void refresh() override;
  std::span<const Contact> contacts() const override;
  const Settings& settings() const override { return settings_; }
  bool tests_contacts() const override { return contacts_ != nullptr; }
  std::string version() const override;
  std::vector<std::string> notes() const override;

  /// For tests and measurements.
  dWorldID world_id() const { return ids_.world.get(); }
  const Joints& joints() const { return *joints_; }

 private:
  void build();
  StepInput with_tendons(const StepInput& input);
  void set_gravity();
  void write(const model::State& state);
  bool immovable_moved(const model::State& state) const;
  /// One step of ODE's, ending at the time `end`; `state_` is not read from the bodies yet.
  StepReport make_step(const StepInput& input, double end);
  void solve(const StepInput& input, StepReport& report);
  bool residual_is_due(const StepReport& report);
  void prepare(const StepInput& input, StepReport& report);
  void actuate(const StepInput& input);
  /// @throws Error where ODE has no memory for the step; the world is as before it.
  void advance();
  std::optional<PhysicsFault> body_fault(double time) const;
  std::optional<PhysicsFault> read_bodies(double time);
  void give_up_step();
  PhysicsFault described(const OdeFault& fault) const;
  [[noreturn]] void fail(PhysicsFault fault);
  [[noreturn]] void fail(const OdeFault& fault);

  const model::Model& model_;
  Settings settings_;
  OdeIds ids_;
  std::vector<bool> immovable_;
  std::vector<OdeBody> bodies_;      ///< as Model::bodies
  std::vector<std::size_t> moving_;  ///< indices of bodies that have an ODE body
  std::unique_ptr<Joints> joints_;
  std::vector<StepForecast::Driven> ways_;  ///< of driven bodies in the step; with wrist_motion only
  std::unique_ptr<Contacts> contacts_;      ///< with contact effects and rules only
  ResidualMeter residual_;
  int stop_rows_ = 0;           ///< joint stops in force in the last step
  std::vector<System> closed_;  ///< islands to close after every step; with projection only
  model::State opened_;         ///< at the start of the step; with projection only
  model::State state_;
  std::vector<StepStart> start_;         ///< as moving_, of the solver's step, which may be made again
  std::unique_ptr<Muscles> muscles_;     ///< with tendons in effect only
  std::vector<double> torques_, drag_;   ///< of the step, tendons' share included
  std::vector<double> tau_, tau_servo_;  ///< of the step under way
  std::optional<Error> failure_;
};

}  // namespace handsim::engine::ode
