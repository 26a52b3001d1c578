// The differential-algebraic engine: the reference for any model whose motion is smooth, that is, without
// contacts and joint stops. Maximal coordinates, exact gyroscopic torques, driven and kinematic bodies as
// prescribed motion; each island (a finger on a still palm) is integrated on its own by the formulation that
// the settings name.
//
// A state handed to set_state is a new start: positions and velocities are moved onto the joints (not by
// euler_linearised, which never does), and multistep formulations build up their order again, so a resumed
// run agrees within the formulation's error and not to the bit (see restore for that). Driven bodies are
// where their drives put them.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "handsim/engine/dae/integrator.h"
#include "handsim/engine/engine.h"
#include "handsim/model/angle_sensor.h"

namespace handsim::engine::dae {

class DaeEngine final : public Engine {
 public:
  /// @throws Error (input) also for contact effects, for joint_stops where a joint has any, and for joints
  ///         that cannot all be closed at the start. The model must outlive the engine.
  DaeEngine(const model::Model& model, const Settings& settings);

  StepReport step(const StepInput& input) override;
  const model::State& state() const override { return state_; }
  void set_state(const model::State& state) override;
  void save(ArchiveWriter& out) const override;
  /// Bit-exact, unlike set_state: stabilised_gear integrates over its past since torques or the choice of
  /// constraint rows last changed, which takes as long as it did then.
  void restore(const model::State& state, ArchiveReader& in) override;
  std::span<const Contact> contacts() const override { return {}; }
  const Settings& settings() const override { return settings_; }
  bool tests_contacts() const override { return false; }
  std::string version() const override;
  std::vector<std::string> notes() const override { return notes_; }

 private:
  void start(const model::State& state);
  void drive(double time, model::KeySide side, model::State& state) const;
  void find_torques(std::span<const double> given, model::State& state) const;
  void check_bodies(const model::State& state) const;
  [[noreturn]] void fail(const Error& error);

  const model::Model& model_;
  Settings settings_;
  System drives_;  ///< without bodies of its own: moves the driven ones
  std::vector<std::unique_ptr<Integrator>> islands_;
  std::vector<std::string> notes_;
  model::JointSensors sensors_;
  model::State state_;
  std::optional<Error> failure_;
};

}  // namespace handsim::engine::dae
