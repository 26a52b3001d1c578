// A Model as URDF, the robot description of ROS: links with masses and collision shapes, joints with ranges.
// A pure function of the model and the settings.
#pragma once

#include <string>

#include "handsim/engine/settings.h"
#include "handsim/model/model.h"

namespace handsim::output {

/// One tree from link `world`. A universal joint becomes two revolute joints with a link of 1e-12 kg between
/// them, a capsule a cylinder with a sphere at either end (URDF has no capsule), a free body hangs on a
/// floating joint, a kinematic one on a fixed joint where it starts. Efforts are not limited in a Model: they
/// are written as 1000 N m.
/// @throws Error (input) for what URDF cannot say without more files: ball joints, loops, meshes.
std::string to_urdf(const model::Model& model, const engine::Settings& settings);

}  // namespace handsim::output
