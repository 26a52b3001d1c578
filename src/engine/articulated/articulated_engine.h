// The engine on recursive algorithms in joint coordinates (Featherstone 2008): joints cannot come apart, and only
// the degrees of freedom there are get stepped. Branches of one shape (fingers) share the lanes of the vector unit.
//
// The same bits from every instruction set. State() is made from the joint coordinates when it is asked for. Going
// on from a saved state agrees within rounding, not to the bit: poses have to become coordinates again.
// Does no contacts.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "handsim/engine/articulated/mechanism.h"

namespace handsim::engine::articulated {

class ArticulatedEngine final : public Engine {
 public:
  /// @param kernel null: the fastest one. @throws Error (input); the model must outlive the engine.
  ArticulatedEngine(const model::Model& model, const Settings& settings, const Kernel* kernel = nullptr);

  StepReport step(const StepInput& input) override;
  const model::State& state() const override;
  void set_state(const model::State& state) override;
  std::span<const Contact> contacts() const override { return {}; }
  const Settings& settings() const override { return settings_; }
  bool tests_contacts() const override { return false; }
  std::string version() const override;
  std::vector<std::string> notes() const override { return notes_; }

  /// For tests and measurements.
  const Mechanism& mechanism() const { return mechanism_; }

 private:
  void start(const model::State& state);
  void accept(const StepInput& input);
  int step_implicitly();
  bool drive_bases(double end);
  void check(bool sound, double time);
  [[noreturn]] void fail(PhysicsFault fault);

  const model::Model& model_;
  Settings settings_;
  Mechanism mechanism_;
  std::vector<int> drives_;  ///< of the model, in force
  std::vector<double> saved_;
  std::vector<std::string> notes_;
  double time_ = 0;
  bool had_torques_ = false;
  mutable model::State state_;
  mutable bool fresh_ = false;
  std::optional<Error> failure_;
};

}  // namespace handsim::engine::articulated
