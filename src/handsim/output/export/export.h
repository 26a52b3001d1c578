// Exports a Model for other programs: pure functions of the model and the settings; and the table of all
// formats of `handsim export`, those of the Python package included. A new format is a row of it and its
// writer.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/control/controller.h"
#include "handsim/control/plan.h"
#include "handsim/engine/settings.h"
#include "handsim/model/actuation.h"
#include "handsim/model/model.h"
#include "handsim/model/state.h"

namespace handsim::output {

struct Keyframe {
  model::State state;
  std::vector<model::Servo>
      drives;  ///< of the controller, by coordinate; empty: the plan's gains and targets
};
/// After a step. @param controller that commanded the step; null: none
Keyframe keyframe_after(const model::State& state, const control::Controller* controller);

/// MJCF, the model format of MuJoCo (2.2 and newer): bodies, joints with ranges and tissue, shapes, contact
/// pairs and surfaces, masses, an actuator on every axis, the initial state as keyframe `initial`.
///
/// Body frames are the model's (origin at the centre of mass), angles are in radians, and all digits are
/// written. Each joint axis becomes a joint named `joint.axis`; a ball joint keeps its name; an actuator has
/// the name of its joint. Joint limits need the effect joint_stops, joint stiffness and damping
/// passive_tissue, gravity the effect gravity, friction the effect friction. Kinematic bodies are fixed at
/// their start, driven ones are mocap bodies. Loops are closed by `connect` constraints, which are compliant
/// in MuJoCo. Two shapes whose surfaces MuJoCo would combine otherwise than model::combined() get a `pair` of
/// their own; springs and dampers of surfaces act at the end of the file's step, as they do here (solref,
/// solimp). Muscles and bands in effect become fixed tendons with the moment arms of the start, and actuators
/// of the muscles' names with their isometric forces there. A band that goes slack is a limit of its tendon.
/// @param plan axes that it drives get a position actuator with its gains and torque limit (without integral
///        and feed-forward), others a motor. The keyframe has the targets at the start.
/// @param moment the start, with drives as they are there, feed-forward torques included, which remain what
///        they are; null: the model's initial state
/// @throws Error (input) for loops closed by universal or slider joints and more than 32 contact groups.
std::string to_mjcf(const model::Model& model, const engine::Settings& settings,
                    const control::Plan* plan = nullptr, const Keyframe* moment = nullptr);

/// URDF, the robot description of ROS: links with masses and collision shapes, joints with ranges.
///
/// The tree starts at link `world`. A universal joint becomes two revolute joints with a link of 1e-12 kg
/// between them. A capsule becomes a cylinder with a sphere at each end (URDF has no capsule). A free body
/// gets a floating joint, a kinematic body a fixed joint at its start. URDF requires limits of effort and
/// speed: effort is the plan's torque limit, and where a Model has no limit both are 1000.
/// @throws Error (input) for what URDF cannot express without more files: ball joints, loops, meshes.
std::string to_urdf(const model::Model& model, const engine::Settings& settings,
                    const control::Plan* plan = nullptr);

/// The model format of OpenSim 4: bodies, joints with ranges, springs and dampers of tissue, muscles and
/// bands, the points of model::hand_markers() as markers, spheres and planes as contact geometry, shapes to
/// look at.
///
/// Body frames are the model's, with all digits. Hinges, universal joints, sliders and ball joints become
/// OpenSim's own, with one coordinate named `joint.axis` for each axis, of the same sign. A free palm's
/// coordinates `right.palm.world.rx` to `.tz` move its hand frame (an object's: its body) relative to the
/// start, where they are zero; those of a driven palm are prescribed, sampled every 10 ms. A fixed body is
/// welded to the ground. Ranges need the effect joint_stops, springs passive_tissue, gravity the effect
/// gravity. Muscles in effect become RigidTendonMuscles along paths whose lengths are polynomials of the
/// coordinates: with the model's moment arms within the range of their polynomials, its forces at rest, and
/// its force by speed at full activation; activation is excitation, and elastic tendons are rigid. Left out:
/// contact forces, stops as forces, motors, boxes, cylinders and meshes as contact geometry.
/// @throws Error (input) for loops and for universal joints whose axes are not perpendicular.
std::string to_osim(const model::Model& model, const engine::Settings& settings);

/// What a writer of this library gets; see to_mjcf() for plan and moment.
struct Exported {
  const model::Model& model;
  const engine::Settings& settings;
  const control::Plan* plan = nullptr;
  const Keyframe* moment = nullptr;
};

/// A format of `handsim export`.
struct Format {
  std::string_view name;  ///< of `--format`
  std::array<std::string_view, 2>
      endings;                  ///< of the file; the first is the default, the second may be empty
  std::string_view text;        ///< whom it is for, and what is in it
  std::string_view of;          ///< what it is written of: some of scene, hand and run
  std::string_view needs;       ///< a package beside NumPy; empty: none
  std::string_view file, mark;  ///< what such a file is, and what its beginning has (output::FileKind)
  std::string (*write)(const Exported& of);  ///< null: python/handsim/export.py writes it

  /// `.xml or .mjcf`
  std::string endings_text() const {
    return std::string(endings[0]) + (endings[1].empty() ? "" : " or ") + std::string(endings[1]);
  }
};

/// The one table of formats: command line, Python, help, completion and docs/export.md read it.
inline constexpr std::array kFormats = {
    Format{"mjcf",
           {".xml", ".mjcf"},
           "MuJoCo: model, drives, contact rules, the state at the start or at --time",
           "scene, hand",
           "",
           "an MJCF file",
           "<mujoco",
           [](const Exported& of) { return to_mjcf(of.model, of.settings, of.plan, of.moment); }},
    Format{"urdf",
           {".urdf"},
           "ROS and robots' programs: links, joints, shapes that collide",
           "scene, hand",
           "",
           "a URDF file",
           "<robot",
           [](const Exported& of) { return to_urdf(of.model, of.settings, of.plan); }},
    Format{"osim",
           {".osim"},
           "OpenSim: bodies, joints, tissue, muscles, markers",
           "scene, hand",
           "",
           "an OpenSim file",
           "<OpenSimDocument",
           [](const Exported& of) { return to_osim(of.model, of.settings); }},
    Format{"glb",
           {".glb"},
           "glTF, for viewers and animators: skin with a skeleton, shapes, motion",
           "scene, hand, run",
           "",
           "a binary glTF file",
           "glTF",
           nullptr},
    Format{"usda",
           {".usda"},
           "USD as text: skin, shapes, motion, masses and joints",
           "scene, hand, run",
           "",
           "a USD text file",
           "#usda",
           nullptr},
    Format{"obj",
           {".obj"},
           "surfaces at a moment, in metres",
           "scene, hand, run",
           "",
           "an OBJ file of handsim",
           "# handsim: metres",
           nullptr},
    Format{"stl",
           {".stl"},
           "surfaces at a moment for printers, in millimetres",
           "scene, hand, run",
           "",
           "an STL file of handsim",
           "handsim: millimetres",
           nullptr},
    Format{"mcap",
           {".mcap"},
           "ROS 2 messages of the motion, for Foxglove and rosbags",
           "scene, run",
           "mcap-ros2-support",
           "an MCAP file",
           "MCAP0",
           nullptr},
};

}  // namespace handsim::output
