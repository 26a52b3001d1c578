// Exports a Model for other programs: pure functions of the model and the settings.
#pragma once

#include <string>

#include "handsim/engine/settings.h"
#include "handsim/model/model.h"

namespace handsim::output {

/// MJCF, the model format of MuJoCo: bodies, joints with ranges and tissue, shapes, contact filters, masses,
/// a motor on every axis, and the initial state as keyframe `initial`.
///
/// Body frames are the model's (origin at the centre of mass), angles are in radians, and all digits are
/// written. Each joint axis becomes a joint named `joint.axis`; a ball joint keeps its name; a motor has the
/// name of its joint. Joint limits need the effect joint_stops, joint stiffness and damping passive_tissue,
/// gravity the effect gravity, muscles and bands their effects: fixed tendons with the moment arms of the start, and
/// actuators of the muscles' names with their isometric forces
/// there. A band that goes slack is a limit of its tendon. Kinematic bodies are fixed at their start, driven ones are mocap bodies. Loops
/// are closed by `connect` constraints, which are compliant in MuJoCo.
/// @throws Error (input) for what MJCF cannot express: loops closed by universal or slider joints, more than
///         32 contact groups.
std::string to_mjcf(const model::Model& model, const engine::Settings& settings);

/// URDF, the robot description of ROS: links with masses and collision shapes, joints with ranges.
///
/// The tree starts at link `world`. A universal joint becomes two revolute joints with a link of 1e-12 kg
/// between them. A capsule becomes a cylinder with a sphere at each end (URDF has no capsule). A free body
/// gets a floating joint, a kinematic body a fixed joint at its start. URDF requires limits of effort and
/// speed, which a Model does not have: they are written as 1000.
/// @throws Error (input) for what URDF cannot express without more files: ball joints, loops, meshes.
std::string to_urdf(const model::Model& model, const engine::Settings& settings);

}  // namespace handsim::output
