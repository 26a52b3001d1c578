// Fits a grip to a person's hand and an object: where the object lies, and the angles at which fingers are
// open, touch, and press with their forces through the joints' springs. A right hand, in the hand frame.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "handsim/control/poses.h"
#include "handsim/scene/task/closing.h"
#include "handsim/scene/task/grip_balance.h"

namespace handsim::scene {

/// How the object is brought to its place in the hand.
struct GripPlace {
  Pose at;                     ///< X_HO, of a hand of this person's size
  bool on_palm = false;        ///< the object is moved along the hand's z axis until it touches the palm
  Vec3 from = Vec3::Zero();    ///< start of the hand's approach, in the hand frame [m]
  Vec3 weight = Vec3::Zero();  ///< of the object, in the hand frame [N]
  std::vector<Vec3> loads;     ///< weight and strongest shake by its directions, in the hand frame [N]
};

struct FittedGrip {
  Pose x_HO;
  control::PoseSpec open, touch, press;
  std::map<model::Part, double> forces;  ///< normal forces of the fingers that touch [N]
  double palm_force = 0;                 ///< [N]
  hand::GripStrength strength;
  std::vector<Problem> problems;  ///< why the hand cannot hold the object so; keys without the task's path
  std::vector<std::string> warnings;
};

/// Fits the grip of a task between the poses `open` and `closed` of the scene's pose file.
FittedGrip fit_grip(const TaskSite& site, const GripSpec& spec, const GripPlace& place, const TaskSpec& task);

}  // namespace handsim::scene
