// PID control of a hand's joints: joint state and targets in, joint torques or servo drives out, for any
// engine. A step goes: command(state) -> the engine's step -> observe(state). The derivative acts on the
// measured rate, so a moving target gives no torque peak; the integral stops where it would only push a
// saturated joint further (anti-windup).
#pragma once

#include <span>
#include <vector>

#include "handsim/control/gravity.h"
#include "handsim/control/plan.h"
#include "handsim/core/archive.h"
#include "handsim/model/actuation.h"
#include "handsim/model/state.h"

namespace handsim::control {

/// What a driven axis does, as of the last observe().
struct AxisState {
  double angle = 0;   ///< [rad]
  double rate = 0;    ///< [rad/s]
  double target = 0;  ///< for the time of the state [rad]
  double torque = 0;  ///< that the drive applied in the last step, within the limit [N m]
  bool at_limit = false;
};

class Controller {
 public:
  /// Model and plan must outlive the controller. @param step of the engine [s].
  /// @param start the engine's state before its first step.
  Controller(const model::Model& model, const Plan& plan, double step, const model::State& start);

  /// Angles [rad] to hold from the next command() on in place of the trajectories', one for each of axes(),
  /// until release_targets(). @throws Error (input) for another number or one that is not finite.
  void set_targets(std::span<const double> targets);
  void release_targets() { given_.clear(); }
  /// Works out what acts during the step that begins with the state last observed.
  void command(const model::State& state);
  /// Reads angles and rates after the step, and what the drives have done in it.
  void observe(const model::State& state);

  /// Of the last command(); torques of explicit gains or servos of implicit ones, size model.dof_count(), the
  /// other empty.
  std::span<const double> torques() const { return torques_; }
  std::span<const model::Servo> servos() const { return servos_; }
  /// By driven axis, as Plan::axes.
  std::span<const AxisState> axes() const { return axes_; }
  const Plan& plan() const { return plan_; }

  /// What the controller keeps from step to step: with the engine's state it repeats a run to the bit.
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);

 private:
  /// Numbers of an axis that do not change.
  struct Law {
    Gains gains;
    std::size_t dof = 0;
    std::size_t target = 0;       ///< in targets_, by hand and column
    double tissue_stiffness = 0;  ///< to be fed forward, 0 without compensation [N m/rad]
    double tissue_rest = 0;       ///< [rad]
    double smoothing = 1;         ///< share of the new rate in the filtered one
    double zone = 0;              ///< of the integral [rad]; infinity for none
  };
  struct Memory {
    std::vector<double> integral;       ///< torque of the integral, by axis [N m]
    std::vector<double> filtered_rate;  ///< low-passed rate, by axis [rad/s]
  };
  template <class Archive, class Self>
  static void carry(Archive& archive, Self& self);
  void update_targets(double time);
  double feed(std::size_t axis, double target);
  void drive_explicit();
  void drive_implicit();
  void sense(const model::State& state);

  const Plan& plan_;
  double step_;
  std::vector<Law> laws_;
  std::vector<double> targets_;            ///< for the end of the step, hand after hand
  std::vector<std::size_t> first_target_;  ///< of each hand in targets_
  std::vector<double> given_;              ///< by axis, in place of the trajectories'; empty: those
  std::optional<GravityLoad> load_;
  std::span<const double> weight_;  ///< torques that hold the weight; empty without compensation
  std::vector<AxisState> axes_;
  std::vector<double> torques_;
  std::vector<model::Servo> servos_;
  Memory memory_;
};

}  // namespace handsim::control
