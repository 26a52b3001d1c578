// Places a built hand in a Model, as a right one or its exact mirror image, and attaches it to the world.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "handsim/hand/built_hand.h"

namespace handsim::hand {

/// How the palm is attached to the world.
enum class Mount {
  fixed,      ///< the palm does not move: no constraint rows
  hinge,      ///< the wrist's first axis (flexion)
  universal,  ///< the wrist's two axes
  free,       ///< the palm is free
  driven,     ///< the hand frame follows a timed trajectory
  rail,       ///< the palm slides along a line in the world without rotation
};

/// Pose and attachment of a hand in the world.
struct Placement {
  std::string name = "right";  ///< prefix of all its bodies and joints
  model::Side side = model::Side::right;
  Mount mount = Mount::fixed;
  Pose pose;                                         ///< X_WH at the start
  Vec3 velocity = Vec3::Zero();                      ///< `free`: of the wrist at the start, world axes [m/s]
  Vec3 angular_velocity = Vec3::Zero();              ///< `free`: of the whole hand at the start [rad/s]
  Vec3 rail_direction = {0, 0, -1};                  ///< `rail`: world, unit
  model::PoseMotion motion;                          ///< `driven`: X_WH over time
  std::map<std::string, std::vector<double>> start;  ///< angles by joint name [rad]; others are 0
  double tissue_stiffness = 1;                       ///< factor on the hand model's passive stiffness
  double tissue_damping = 1;                         ///< factor on its passive damping
  /// Strain of all tendons at their muscles' largest isometric force; absent: tendons are rigid.
  std::optional<double> tendon_strain;
  std::optional<double> short_range;  ///< model::Muscle::short_range of all muscles
};

/// Name of a rail's joint: a slider whose coordinate [m] is the distance from Placement::pose along the rail.
inline constexpr const char* kRailName = "rail";

/// A hand's contact groups, in Model::groups.
struct HandGroups {
  int palm = 0;
  int fingers = 0;     ///< all segments but the last
  int fingertips = 0;  ///< the last segment of each finger
};

/// Appends the hand to the model, with its muscles and bands, its skin as material and its contact groups:
/// `palm-NAME`, `fingers-NAME` and `fingertips-NAME`. Tendons have no arms about axes that the mount omits.
/// @throws Error (input) if `start` has an unknown joint or too many angles, or the wrist too few axes.
HandGroups add_hand(model::Model& model, const BuiltHand& hand, const Placement& placement);

}  // namespace handsim::hand
