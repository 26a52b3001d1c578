// Makes a control plan from controller file, poses and built hands: gains in N m/rad and limits of each
// driven axis, the trajectory of each hand. Reports all mistakes in these files before the first step.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "handsim/control/gains.h"
#include "handsim/control/motion_trajectory.h"
#include "handsim/control/poses.h"
#include "handsim/control/trajectory.h"
#include "handsim/model/effects.h"

namespace handsim::control {

/// A joint coordinate that the controller drives, and its gains as numbers.
struct DrivenAxis {
  std::string name;                              ///< e.g. `right.index_mcp.flexion`
  std::size_t hand = 0;                          ///< in Plan::hands
  std::size_t column = 0;                        ///< of the hand's trajectory
  std::size_t joint = 0;                         ///< in Model::joints
  std::size_t axis = 0;                          ///< of the joint
  std::size_t dof = 0;                           ///< in vectors of model.dof_count()
  double inertia = 0;                            ///< effective inertia for designed gains [kg m^2]
  double proportional = 0;                       ///< [N m/rad]
  double derivative = 0;                         ///< [N m s/rad]
  double integral = 0;                           ///< [N m/(rad s)]
  double torque_limit = 0;                       ///< [N m]
  std::optional<double> derivative_cutoff = {};  ///< [Hz]
  std::optional<double> integral_zone = {};      ///< [rad]
};

struct HandPlan {
  std::string name;
  model::Side side = model::Side::right;
  Trajectory trajectory;
};

struct Plan {
  Form form = Form::implicit_gain;
  bool tissue_compensation = false;
  std::optional<Vec3> gravity;       ///< The gravity that is compensated [m/s^2]; absent: no compensation.
  bool feed_forward = false;         ///< torques of inverse dynamics along the targets
  Vec3 feed_gravity = Vec3::Zero();  ///< that they carry [m/s^2]
  std::vector<HandPlan> hands;
  std::vector<DrivenAxis> axes;  ///< hand by hand, in the order of the hand's joints
  std::vector<std::string> warnings;
};

/// Source of a hand's target angles: a program of the pose file by name, or a motion file.
struct ProgramChoice {
  std::string program;
  Place place;
  std::string key;  ///< for messages
};

struct PlanInput {
  const ControllerSpec* controller = nullptr;
  MotionOptions motion;                          ///< for motion files
  const PoseFile* poses = nullptr;               ///< null if every hand has a motion file
  std::vector<ProgramChoice> programs;           ///< one for each hand of the model, in their order
  std::vector<std::vector<std::string>> absent;  ///< for each hand the joints that its mount omits
  std::vector<double> strength;                  ///< for each hand the factor on its torque limits; empty: 1
  model::Effects effects;                        ///< effects that are off are not compensated
  double step = 1e-3;                            ///< [s]
  bool allow_unstable = false;  ///< accepts explicit gains beyond their limit, with a warning
};

/// Designed gains use the largest effective inertia over the start and the poses of the hand's program, so
/// that the damping ratio is reached at every pose. Problems go into the diagnostics.
Plan make_plan(const model::Model& model, const PlanInput& input, Diagnostics& diagnostics);

}  // namespace handsim::control
