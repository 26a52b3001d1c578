// What a scene file says, as plain structs in SI, and its reader.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "handsim/hand/build.h"
#include "handsim/model/solver.h"
#include "handsim/model/view.h"
#include "handsim/scene/compile/mass_properties.h"
#include "handsim/scene/compile/mechanism.h"
#include "handsim/scene/read/control_spec.h"
#include "handsim/scene/task/climb.h"
#include "handsim/scene/task/grasp.h"

namespace handsim::scene {

struct HandEntry {
  hand::HandSpec model;
  hand::Person person;
  hand::Placement placement;
  Place place;         ///< in the file, for problems found later
  Place person_place;  ///< of the person's file or block
};

/// A thing of one shape, or a compound of several that move as one. Its frame O is the one in which its
/// shapes are given; its body's frame has O's axes and stands at the centre of mass.
struct ObjectSpec {
  std::string name;
  std::vector<model::Shape> shapes;      ///< kind, size and pose X_OS, nothing else; at least one
  MassProperties body;                   ///< in O; static: none
  bool is_static = false;                ///< does not move
  bool may_overlap = false;              ///< starts inside a hand if it does
  Pose pose;                             ///< X_WO at the start
  Vec3 velocity = Vec3::Zero();          ///< of the centre of mass [m/s]
  Vec3 angular_velocity = Vec3::Zero();  ///< world axes [rad/s]
  model::Material material;
  std::optional<std::string> source;  ///< where its figures come from
  Place place;                        ///< in the file, for problems found later

  Pose body_frame() const { return {body.centre, Quat::Identity()}; }  ///< X_OB
};

struct GroundSpec {
  double height = 0;  ///< z of the plane [m]
  model::Material material;
};

/// Who meets whom, by names of groups.
struct ContactRuleSpec {
  std::array<std::string, 2> between;
  std::optional<std::string> material;  ///< absent: combined from the two surfaces
  Place place;
};

struct ContactsSpec {
  std::vector<model::Material> materials;             ///< by name
  std::optional<std::vector<ContactRuleSpec>> rules;  ///< absent: all that the effects let meet
};

/// Limits that decide whether a run has succeeded; absent ones are measured but not judged.
struct Criteria {
  std::optional<double> joint_gap;       ///< largest gap of any joint at any step [m]
  std::optional<double> stop_overshoot;  ///< largest overshoot of a stop beyond impact rate times step [rad]
  std::optional<double> stop_rest;       ///< largest overshoot of a stop at the end [rad]
  std::optional<int> lcp_failures;       ///< in all
  std::optional<double> penetration;     ///< largest depth of any contact at any step [m]
  std::optional<int> tunnelling;         ///< pairs of shapes that passed or lay deep in each other
  std::optional<double> grasp_slip;      ///< mean drift of a grasped object in the palm during the hold [m/s]
  std::optional<double> climb_load;      ///< least load that a climb is to carry [N]
  TrackingCriteria tracking;             ///< of a controlled scene
};

using model::View;

struct CameraSpec {
  Vec3 position = {0.5, -0.7, 0.5};  ///< [m]
  Vec3 target = Vec3::Zero();        ///< [m]
  double field_of_view = 0.6;        ///< vertical [rad]
};

struct PictureSpec {
  std::array<int, 2> size = {1280, 960};  ///< pixels
  View view = View::three_quarter;        ///< framed to all that moves
  std::optional<CameraSpec> camera;       ///< in place of the view
  bool floor = true;                      ///< a floor to cast shadows on where the scene has no ground
  bool joint_axes = false;
  bool contact_points = false;
  bool contact_forces = false;  ///< arrows, through whatever hides them
};

struct SceneSpec {
  std::string title;
  std::vector<HandEntry> hands;
  std::vector<ObjectSpec> objects;
  std::optional<GroundSpec> ground;
  ContactsSpec contacts;
  MechanismSpec mechanism;
  Vec3 gravity = {0, 0, -9.80665};  ///< [m/s^2]
  model::SolverSettings solver;     ///< with the effects, `auto` resolved
  std::string engine_choice;        ///< what engine `auto` came to, and why; empty where the scene names one
  double duration = 1;              ///< [s]
  double record_every = 0.01;       ///< [s]
  bool record_contacts = false;     ///< contacts.csv, and sums of contact forces in the summary
  std::optional<ControlSpec> control;  ///< drives the joints; with actuation only
  std::vector<GraspSpec> grasps;
  std::vector<GraspPlan> grasp_plans;  ///< one for each of the grasps
  std::vector<ClimbSpec> climbs;
  std::vector<ClimbPlan> climb_plans;  ///< one for each of the climbs
  PictureSpec pictures;
  Criteria criteria;
};

/// Reads a scene, following its references. Problems go into the diagnostics, and defaults and referenced
/// files into the tree, which is then the resolved scene.
SceneSpec read_scene(YamlNode& root, Diagnostics& diagnostics);

}  // namespace handsim::scene
