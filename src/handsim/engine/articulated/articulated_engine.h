// The engine on recursive algorithms in joint coordinates (Featherstone 2008): joints cannot come apart, and
// only the degrees of freedom there are get stepped. Branches of one shape (fingers) share the lanes of the
// vector unit.
//
// Every instruction set gives equal bits. State() is made from the joint coordinates when it is asked for.
// Going on from a state handed to set_state agrees within rounding, not to the bit: poses have to become
// coordinates again (see restore for that).
// Method semi_implicit_euler has all effects; rk4 and dormand_prince are for motion without stops and
// contact.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "handsim/engine/articulated/contact/contact_dynamics.h"
#include "handsim/engine/articulated/derivatives/step_slopes.h"
#include "handsim/engine/articulated/dynamics/muscle_coupling.h"
#include "handsim/engine/articulated/dynamics/smooth.h"
#include "handsim/engine/articulated/fast_spin.h"
#include "handsim/engine/articulated/momentum.h"

namespace handsim::engine::articulated {

class ArticulatedEngine final : public Engine {
 public:
  /// The model must outlive this object. @param kernel null: the fastest one. @throws Error (input), also for
  /// loops that cannot be closed and, by methods for smooth motion, for joint_stops with stops and for
  /// contact
  ArticulatedEngine(const model::Model& model, const Settings& settings, const Kernel* kernel = nullptr);

  StepReport step(const StepInput& input) override;
  const model::State& state() const override;
  void set_state(const model::State& state) override;
  /// Bit-exact, unlike set_state: the coordinates themselves, and the impulses that contacts start from.
  void save(ArchiveWriter& out) const override;
  void restore(const model::State& state, ArchiveReader& in) override;
  void refresh() override;
  std::span<const Contact> contacts() const override;
  const Settings& settings() const override { return settings_; }
  bool tests_contacts() const override { return contact_ != nullptr; }
  std::string version() const override;
  std::vector<std::string> notes() const override { return notes_; }

  /// From now on steps fill in derivatives, until null is given; see articulated_engine_derivatives.h.
  void derive(StepDerivatives* out) const { derive_ = out; }

  /// For tests and measurements.
  const Mechanism& mechanism() const { return mechanism_; }

  ArticulatedEngine(const ArticulatedEngine&) = delete;
  ArticulatedEngine& operator=(const ArticulatedEngine&) = delete;

 private:
  void reset(const model::State& state);
  void check_input(const StepInput& input);
  void accept(const StepInput& input);
  StepReport make_step(const StepInput& input);
  int solve_step();
  void step_implicitly(const StepInput& input, double end, StepReport& report);
  bool correct_end(bool fast);
  void begin_derivatives();
  void undo_derivatives();
  void compute_derivatives(const StepInput& input, const StepReport& report);
  void collide(StepReport& report);
  void write_state() const;
  void write_bodies() const;
  /// The drives of the model, where the effect wrist_motion is listed.
  std::span<const model::Drive> drives() const {
    return std::span(model_.drives)
        .first(settings_.effects.has(model::Effect::wrist_motion) ? model_.drives.size() : 0);
  }
  void compute_targets(std::span<const Pose> given, double end);
  bool set_base_velocities();
  void place_bases();
  void save_start();
  void restore_start();
  void check(bool sound, double time) const;

  const model::Model& model_;
  Settings settings_;
  Mechanism mechanism_;
  std::unique_ptr<Loops> loops_;              ///< with loops only
  std::unique_ptr<MuscleCoupling> muscles_;   ///< with tendons in effect only
  std::unique_ptr<ContactDynamics> contact_;  ///< with a contact effect and rule only
  std::unique_ptr<Smooth> smooth_;            ///< with a method for smooth motion only
  std::unique_ptr<FastSpin> fast_spin_;       ///< without one only
  MomentumBalance momentum_;
  std::unique_ptr<StepSlopes> slopes_;  ///< with derivatives only
  mutable StepDerivatives* derive_ = nullptr;
  std::string derived_from_;                ///< what `save` writes, of the step with derivatives
  std::vector<double> uncorrected_;         ///< rates
  std::vector<double> saved_;               ///< positions, rates and torques before the step
  std::vector<BaseMotion> saved_bases_;     ///< of the drives
  std::vector<StepForecast::Driven> ways_;  ///< of the drives, during the step
  std::vector<Pose> targets_;               ///< of the drives, at the end of the step
  std::vector<std::string> notes_;
  double time_ = 0;
  mutable model::State state_;
  /// `stepped`: a step has moved the coordinates on since state_ was written, which the next `state()` does.
  enum class Phase : char { stated, stepped };
  mutable std::atomic<Phase> phase_ = Phase::stated;
  mutable std::mutex writing_;  ///< of state_: several threads may ask for it at once
  std::optional<Error> failure_;
};

}  // namespace handsim::engine::articulated
