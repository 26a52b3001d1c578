// Other engines in the place of handsim's own, so that the hard cases of config/stability.yaml are judged by
// the same measures: a program that links replace_engine.cpp (with the linker option that CMakeLists.txt
// gives it) gets every engine of every simulation from the function that it names.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "handsim/engine/engine.h"

namespace handsim::peers {

using MakeEngine =
    std::function<std::unique_ptr<engine::Engine>(const model::Model&, const engine::Settings&)>;

/// From now on; before any simulation and any thread is made.
void use_engine(MakeEngine make);

/// What engines of others have in common: the state as handsim has it, and the faults that it looks for.
class OtherEngine : public engine::Engine {
 public:
  engine::StepReport step(const engine::StepInput& input) final;
  const model::State& state() const final { return state_; }
  void set_state(const model::State& state) final;
  std::span<const engine::Contact> contacts() const final { return contacts_; }
  const engine::Settings& settings() const final { return settings_; }
  bool tests_contacts() const final { return tests_contacts_; }
  std::vector<std::string> notes() const final { return {}; }

 protected:
  /// Stops do not bounce here. @throws Error (input) for what no other engine is told: surfaces that bounce,
  /// bodies that move as told.
  OtherEngine(const model::Model& model, const engine::Settings& settings);

  virtual void put(const model::State& state) = 0;
  /// One step. @throws Error (physics)
  virtual void advance(const engine::StepInput& input) = 0;
  /// Bodies that can move, and contacts.
  virtual void read(model::State& state, std::vector<engine::Contact>& contacts) = 0;

  [[noreturn]] void fail(const std::string& what);
  /// The friction coefficient of all pairs, where they have one.
  std::optional<double> common_friction() const;

  const model::Model& model_;
  const engine::Settings settings_;

 private:
  void check();
  model::State state_;
  std::vector<engine::Contact> contacts_;
  bool tests_contacts_;
  std::optional<PhysicsFault> failure_;
};

}  // namespace handsim::peers
