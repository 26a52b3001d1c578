// A Model for other programs: pure functions of the model and the settings.
#pragma once

#include <string>

#include "handsim/engine/settings.h"
#include "handsim/model/model.h"

namespace handsim::output {

/// MJCF, the model file of MuJoCo: bodies, joints with ranges and tissue, shapes, what may touch what,
/// masses, a motor on every axis, the start as keyframe `initial`.
///
/// Body frames are the model's (origin at the centre of mass), angles in radians, all digits kept. Joint axes
/// become joints named `joint.axis`; a ball joint keeps its name; motors have the name of their joint.
/// Without joint_stops no joint is limited, without passive_tissue none is stiff, without gravity there is
/// none. Kinematic bodies stand still where they start; driven ones are mocap bodies. Loops are closed by
/// `connect`: MuJoCo's are soft.
/// @throws Error (input) for what MJCF cannot express: loops closed by universal or slider joints, more than
///         32 contact groups.
std::string to_mjcf(const model::Model& model, const engine::Settings& settings);

/// URDF, the robot description of ROS: links with masses and collision shapes, joints with ranges.
///
/// One tree from link `world`. A universal joint becomes two revolute joints with a link of 1e-12 kg between
/// them, a capsule a cylinder with a sphere at either end (URDF has no capsule), a free body has a
/// floating joint, a kinematic one a fixed joint where it starts. Efforts are not limited in a Model: they
/// are written as 1000 N m.
/// @throws Error (input) for what URDF cannot express without more files: ball joints, loops, meshes.
std::string to_urdf(const model::Model& model, const engine::Settings& settings);

}  // namespace handsim::output
