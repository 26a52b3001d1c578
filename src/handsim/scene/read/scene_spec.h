// The content of a scene file as plain structs in SI, and its reader. It is not changed after reading.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "handsim/control/plan.h"
#include "handsim/core/yaml_reader.h"
#include "handsim/engine/settings.h"
#include "handsim/hand/build.h"
#include "handsim/model/model.h"
#include "handsim/model/view.h"
#include "handsim/scene/read/contact_spec.h"
#include "handsim/scene/read/objects.h"
#include "handsim/scene/read/task_spec.h"

namespace handsim::scene {

// The `hands` of a scene: model, person, side, wrist, start pose, tissue.

struct HandEntry {
  std::shared_ptr<const hand::HandSpec> model;  ///< of all hands with an equal one
  hand::Person person;
  hand::Placement placement;  ///< unless a task moves the wrist
  Place place;                ///< in the file, for problems found later

  bool has_wrist_joint() const {
    return placement.mount == hand::Mount::hinge || placement.mount == hand::Mount::universal;
  }
};

/// Reads `hands`; may be absent. Hands are named `right`, `left`, `right2`, ...
/// @param tasks if they place hands of a mount, driven wrists may lack a motion, and rails have no pose.
std::vector<HandEntry> read_hands(MapReader& reader, const Tasks& tasks);

// The `control` block of a scene: its controller, and the program of each hand.

struct ControlSpec {
  control::ControllerSpec controller;
  std::optional<control::PoseFile> poses;
  std::vector<control::ProgramChoice> programs;  ///< one for each hand of the scene, in their order
  bool by_muscles = false;                       ///< `drive: muscles`: torques become excitations
  control::MotionOptions motion;                 ///< for programs that are motion files
  bool allow_unstable = false;                   ///< accepts explicit gains beyond their limit
  Place place;                                   ///< of the block
};

/// `excitations`: a table of excitations over time, columns `HAND.MUSCLE`, or `MUSCLE` for every hand.
struct ExcitationSpec {
  std::string file;            ///< empty: the table is in the scene
  control::MotionTable table;  ///< then
  Place place;
};

/// Reads `excitations`, if the scene has it.
std::optional<ExcitationSpec> read_excitations(MapReader& scene);

/// Reads `control`, following its references. @param hands of the scene, named.
/// @param has_tasks true if tasks may drive hands without a program.
ControlSpec read_control(MapReader reader, const std::vector<HandEntry>& hands, bool has_tasks);

// Reads the limits of a run's success. Refuses limits on figures that a scene lacks: they would always pass.

struct SceneSpec;

/// Limits of the tracking figures; figures without a limit are only reported.
struct TrackingCriteria {
  std::optional<double> rms_error;      ///< of the worst joint over the run [rad]
  std::optional<double> largest_error;  ///< of any joint at any step [rad]
  std::optional<double> steady_error;   ///< largest at the end of any hold [rad]
  std::optional<double> overshoot;      ///< largest, as a share of the movement
  std::optional<double> settling_time;  ///< longest, to 2 % of a movement [s]
};

/// Limits that decide whether a run has succeeded; figures without a limit are only reported.
struct Criteria {
  std::optional<double> joint_gap;       ///< largest gap of any joint at any step [m]
  std::optional<double> stop_overshoot;  ///< largest overshoot of a stop beyond impact rate times step [rad]
  std::optional<double> stop_rest;       ///< largest overshoot of a stop at the end [rad]
  std::optional<int> lcp_failures;       ///< of the LCP solver in the run
  std::optional<double> penetration;     ///< largest depth of any contact at any step [m]
  std::optional<int> tunnelling;         ///< pairs of shapes that passed through or deep into each other
  std::optional<double> grasp_slip;      ///< mean drift of a grasped object in the palm during the hold [m/s]
  std::optional<double> climb_load;      ///< least load that a climb must carry [N]
  TrackingCriteria tracking;             ///< of a controlled scene
};

Criteria read_criteria(MapReader reader);

/// Problems: limits on figures that the scene does not measure. Call after all other blocks are read.
void check_criteria(MapReader reader, const SceneSpec& scene);

/// Problems: limits on holds and movements that the hands' programs do not have. @param root of the scene.
void check_tracked(YamlNode& root, const control::Plan& plan, Diagnostics& diagnostics);

// The `bodies` and `joints` of a scene: mechanisms such as a slider-crank, given in the world at their start.

/// A rigid body; its frame is at the centre of mass along the principal axes of inertia.
struct BodySpec {
  std::string name;
  double mass = 0;                       ///< [kg]
  Vec3 inertia = Vec3::Zero();           ///< principal moments about the centre of mass [kg m^2]
  Pose pose;                             ///< X_WB at the start
  Vec3 velocity = Vec3::Zero();          ///< of the centre of mass, world axes [m/s]
  Vec3 angular_velocity = Vec3::Zero();  ///< world axes [rad/s]
  std::optional<model::Shape> shape;     ///< kind, size and pose in the body
  bool collides = false;                 ///< the shape touches objects and ground; otherwise it is only drawn
  model::Material material;
  Place place;
};

/// A joint; its coordinates are zero at the start.
struct MechanismJointSpec {
  std::string name;
  model::JointKind kind = model::JointKind::hinge;
  std::string parent;                  ///< a body's name, or `world`
  std::string child;                   ///< a body's name
  Vec3 position = Vec3::Zero();        ///< of the joint centre in the world at the start [m]
  std::vector<model::JointAxis> axes;  ///< in world axes at the start
  Place place;
};

struct MechanismSpec {
  std::vector<BodySpec> bodies;
  std::vector<MechanismJointSpec> joints;
};

/// Reads `bodies` and `joints` of a scene; both may be absent. @param taken names that no body may have.
MechanismSpec read_mechanism(MapReader& scene, std::vector<std::string> taken,
                             const std::vector<model::Material>& materials);

// Reads the solver settings and the pictures of a scene.

using model::View;

struct CameraSpec {
  Vec3 position = {0.5, -0.7, 0.5};  ///< [m]
  Vec3 target = Vec3::Zero();        ///< [m]
  double field_of_view = 0.6;        ///< vertical [rad]
};

/// What pictures show of a hand: skin, the shapes that touch, or shapes under skin like glass.
enum class HandLook { skin, shapes, both };

struct PictureSpec {
  std::array<int, 2> size = {1280, 960};  ///< pixels
  View view = View::three_quarter;        ///< from this side, framing all moving bodies
  std::optional<CameraSpec> camera;       ///< replaces the view
  bool floor = true;                      ///< draws a floor for shadows if the scene has no ground
  HandLook hands = HandLook::skin;        ///< with drawn tendons, skin is like glass
  bool finger_colours = false;            ///< of skin: each finger has the colour that its shapes have
  std::uint32_t skin_colour = 0xD9AC94;   ///< sRGB
  bool joint_axes = false;
  bool contact_points = false;
  bool contact_forces = false;  ///< arrows, in front of everything
  bool muscles = false;         ///< paths coloured by activation
  bool follow = false;          ///< the camera follows the hands and what they touch
};

/// Reads engine, step and the engine's own settings; keys of other engines are refused. If the command line
/// names the engine, such keys of the file are left out, with a warning.
void read_settings(MapReader& reader, engine::Settings& solver);
/// Handles keys of a `solver` block that the engine does not have. If the command line names `engine`, such
/// keys of the file are removed, with a warning; otherwise they are problems.
/// @param need what is needed in place of a key; nothing for allowed keys. @param why for the warning.
void refuse_keys(MapReader& reader, const std::function<std::optional<std::string>(const YamlEntry&)>& need,
                 const std::string& why);
/// True for a value from `--set`.
bool of_command_line(const YamlNode& node);
bool read_speculative(MapReader& reader);
std::uint64_t read_seed(MapReader& reader);
/// Reads the `solver` block. Call after effects, mechanism and control are read.
void read_solver(MapReader& reader, SceneSpec& scene);

/// @param out what holds for keys that are absent.
PictureSpec read_pictures(MapReader reader, PictureSpec out);

/// A color "#RRGGBB", sRGB; without quotes it is a comment of YAML.
std::optional<std::uint32_t> read_colour(MapReader& reader, const char* key = "color");

// The scene itself.

/// Tables of a run that are written on request.
struct RecordTables {
  bool bodies = false;     ///< bodies.csv: pose and velocity of every body
  bool markers = false;    ///< markers.trc, markers.csv: joint centres and fingertips of every hand
  bool momentum = false;   ///< momentum.csv: mass centre and momentum of every hand
  bool reactions = false;  ///< reactions.csv: force and moment in every joint
};

struct SceneSpec {
  std::string title;
  std::vector<HandEntry> hands;
  std::vector<ObjectSpec> objects;
  std::optional<GroundSpec> ground;
  ContactsSpec contacts;
  MechanismSpec mechanism;
  Vec3 gravity = {0, 0, -9.80665};  ///< [m/s^2]
  engine::Settings solver;          ///< with the effects, `auto` resolved
  std::string engine_choice;        ///< choice of engine `auto` and its reason; empty if the scene names one
  double duration = 1;              ///< [s]
  double record_every = 0.01;       ///< [s]
  bool record_contacts = false;     ///< contacts.csv, and sums of contact forces in the summary
  std::optional<ExcitationSpec> excitations;  ///< of muscles; with muscles only
  RecordTables tables;
  std::optional<ControlSpec> control;  ///< drives the joints; with actuation only
  Tasks tasks;
  PictureSpec pictures;
  Criteria criteria;

  /// Names of the objects, then of those that tasks add.
  std::vector<std::string> object_names() const;
  /// End of the last task [s]; 0 without any.
  double tasks_end() const;
};

/// Reads a scene, following its references. Problems go into the diagnostics, and defaults and referenced
/// files into the tree, which is then the resolved scene.
/// @param kinds of tasks.
SceneSpec read_scene(YamlNode& root, std::span<const TaskKind> kinds, Diagnostics& diagnostics);

}  // namespace handsim::scene
