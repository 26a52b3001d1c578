// Controller file + poses + built hand into what runs: for each driven axis its gains in N m/rad and its
// limits, for each hand its trajectory. All mistakes in files are reported here, before the first step.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "handsim/control/gains.h"
#include "handsim/control/motion_file.h"
#include "handsim/control/poses.h"
#include "handsim/control/trajectory.h"
#include "handsim/model/effects.h"

namespace handsim::control {

/// Gains of one axis, ready to run.
struct Gains {
  double proportional = 0;                  ///< [N m/rad]
  double derivative = 0;                    ///< [N m s/rad]
  double integral = 0;                      ///< [N m/(rad s)]
  double torque_limit = 0;                  ///< [N m]
  std::optional<double> derivative_cutoff;  ///< [Hz]
  std::optional<double> integral_zone;      ///< [rad]
};

/// A driven axis.
struct DrivenAxis {
  std::string name;        ///< e.g. `right.index_mcp.flexion`
  std::size_t hand = 0;    ///< in Plan::hands
  std::size_t column = 0;  ///< of the hand's trajectory
  std::size_t joint = 0;   ///< in Model::joints
  std::size_t axis = 0;    ///< of the joint
  std::size_t dof = 0;     ///< in vectors of model.dof_count()
  Gains gains;
  double inertia = 0;  ///< effective inertia that designed gains rest on [kg m^2]
};

struct HandPlan {
  std::string name;
  model::Side side = model::Side::right;
  Trajectory trajectory;
};

struct Plan {
  Form form = Form::implicit_gain;
  bool tissue_compensation = false;
  /// What gravity compensation holds up against [m/s^2]; absent: no compensation.
  std::optional<Vec3> gravity;
  std::vector<HandPlan> hands;
  std::vector<DrivenAxis> axes;  ///< hand by hand, in the order of the hand's joints
  std::vector<std::string> warnings;
};

/// What drives one hand: a program of the pose file by name, or a motion file.
struct ProgramChoice {
  std::string program;
  Place place;
  std::string key;  ///< for messages
};

struct PlanInput {
  const ControllerSpec* controller = nullptr;
  const PoseFile* poses = nullptr;               ///< null where every hand has a motion file
  std::vector<ProgramChoice> programs;           ///< one for each hand of the model, in their order
  std::vector<std::vector<std::string>> absent;  ///< for each hand the joints that its mount leaves out
  std::vector<double> strength;                  ///< for each hand the scale of its torque limits; empty: 1
  model::Effects effects;                        ///< compensation of effects that are off is nothing
  double step = 1e-3;                            ///< [s]
  bool allow_unstable = false;  ///< lets explicit gains beyond their limit run, with a warning
};

/// Designed gains rest on the largest effective inertia over the start and the poses of the hand's program,
/// so that no pose is less damped than asked. @throws nothing: problems go into the diagnostics.
Plan make_plan(const model::Model& model, const PlanInput& input, Diagnostics& diagnostics);

}  // namespace handsim::control
