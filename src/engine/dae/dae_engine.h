// The differential-algebraic engine: the reference for models with smooth motion, that is, without contacts
// and joint stops. Maximal coordinates, exact gyroscopic torques; driven and kinematic bodies have prescribed
// motion. Each island (e.g. a finger on a fixed palm) is integrated separately by the method of the settings.
//
// set_state is a new start: positions and velocities are projected onto the joint constraints (except with
// euler_linearised) and multistep methods start again at order one. A run that continues from set_state
// therefore agrees only within the error of the method; restore continues with the same bits. The poses of
// driven bodies follow from their drives.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "handsim/engine/dae/integrator.h"
#include "handsim/engine/engine.h"
#include "handsim/engine/muscles.h"
#include "handsim/model/angle_sensor.h"

namespace handsim::engine::dae {

class DaeEngine final : public Engine {
 public:
  /// The model must outlive the engine. @throws Error (input) also for contact effects, for joint_stops if a
  ///         joint has stops, and for joints that cannot all be closed at the start.
  DaeEngine(const model::Model& model, const Settings& settings);

  StepReport step(const StepInput& input) override;
  const model::State& state() const override { return state_; }
  void set_state(const model::State& state) override;
  void save(ArchiveWriter& out) const override;
  /// Continues with the same bits. For that, stabilised_gear repeats its integration since the last change of
  /// torques or of the chosen constraint rows, which takes as long as the first time.
  void restore(const model::State& state, ArchiveReader& in) override;
  std::span<const Contact> contacts() const override { return {}; }
  const Settings& settings() const override { return settings_; }
  bool tests_contacts() const override { return false; }
  std::string version() const override;
  std::vector<std::string> notes() const override { return notes_; }

 private:
  void start(const model::State& state);
  void drive(double time, model::KeySide side, model::State& state) const;
  void set_joint_torques(std::span<const double> given, model::State& state) const;
  void check_bodies(const model::State& state) const;
  [[noreturn]] void fail(const Error& error);

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

}  // namespace handsim::engine::dae
