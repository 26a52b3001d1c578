// PID control of a hand's joints: joint state and targets in, joint torques or servo drives out, for any
// engine. Each step: command(state), the engine's step, observe(state). The derivative acts on the measured
// rate, so a moving target gives no torque peak; the integral is held while the torque is saturated in the
// direction of the error (anti-windup).
#pragma once

#include <span>
#include <vector>

#include "handsim/control/joint_space.h"
#include "handsim/control/plan.h"
#include "handsim/core/archive.h"
#include "handsim/model/actuation.h"
#include "handsim/model/newton_euler.h"
#include "handsim/model/state.h"

namespace handsim::control {

/// State of a driven axis at the last observe(), and what the control law integrates from step to step.
struct AxisState {
  double angle = 0;   ///< [rad]
  double rate = 0;    ///< [rad/s]
  double target = 0;  ///< for the time of the state [rad]
  double torque = 0;  ///< of the drive in the last step, within the limit [N m]
  bool at_limit = false;
  double integral = 0;       ///< torque of the integral [N m]
  double filtered_rate = 0;  ///< low-passed rate [rad/s]
};

class Controller {
 public:
  /// The model and the plan must outlive this object. @param step [s]. @param start the engine's state before
  /// its first step
  Controller(const model::Model& model, const Plan& plan, double step, const model::State& start);

  /// Angles [rad] that replace the targets of the trajectories from the next command() on, one for each of
  /// axes(), until release_targets(). @throws Error (input) for another number or one that is not finite.
  void set_targets(std::span<const double> targets);
  void release_targets() { given_.clear(); }
  /// Computes the torques or servos of the step that begins with the state last observed.
  void command(const model::State& state);
  /// Reads angles and rates after the step, and the torques of the drives in it.
  void observe(const model::State& state);

  /// Results of the last command(): torques of explicit gains or servos of implicit ones; the other is empty.
  std::span<const double> torques() const { return torques_; }
  std::span<const model::Servo> servos() const { return servos_; }
  /// One per driven axis, in the order of Plan::axes.
  std::span<const AxisState> axes() const { return axes_; }
  const Plan& plan() const { return plan_; }

  /// State from step to step: together with the engine's state it reproduces a run bit for bit.
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);

 private:
  /// Inverse dynamics along the targets.
  struct FeedForward {
    model::NewtonEuler dynamics;
    std::vector<double> rates, accelerations;  ///< of targets_
    std::vector<double> q, u, change;          ///< by coordinate of the model
    std::span<const double> torques;           ///< by coordinate
  };
  template <class Archive, class Self>
  static void serialize(Archive& archive, Self& self);
  void update_targets(double time);
  /// The index of an axis in targets_.
  std::size_t target_index(const DrivenAxis& axis) const { return first_target_[axis.hand] + axis.column; }
  double target(std::size_t axis) const { return targets_[target_index(plan_.axes[axis])]; }
  double offset_torque(std::size_t axis, double target);
  void update_feed(const model::State& state);
  void command_torques();
  void command_servos();
  void measure(const model::State& state);

  const Plan& plan_;
  double step_;
  std::vector<DrivenAxis> driven_;         ///< the plan's axes, as they were at the start
  std::vector<model::Tissue> tissue_;      ///< that is compensated, by axis; zero for none
  std::vector<double> smoothing_;          ///< weight of the new rate in the filtered one, by axis
  std::vector<double> targets_;            ///< for the end of the step, hand after hand
  std::vector<std::size_t> first_target_;  ///< of each hand in targets_
  std::vector<double> given_;              ///< by axis; empty: targets of the trajectories
  std::optional<GravityLoad> gravity_;
  std::span<const double> gravity_torques_;  ///< feed-forward; empty without compensation
  std::optional<FeedForward> feed_;
  std::vector<AxisState> axes_;
  std::vector<double> torques_;
  std::vector<model::Servo> servos_;
};

}  // namespace handsim::control
