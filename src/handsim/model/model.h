// The compiled description of a simulation (SI, radians): bodies (0: the world), joints, shapes, materials,
// contact rules, drives. Constant once built. Parents before children but for loop-closing joints.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/core/index.h"
#include "handsim/core/pose.h"
#include "handsim/model/compliance.h"
#include "handsim/model/convex_mesh.h"
#include "handsim/model/material.h"
#include "handsim/model/motion.h"
#include "handsim/model/muscle.h"

namespace handsim::model {

inline constexpr int kWorld = 0;  ///< Index of the world in `Model::bodies`.

/// The part of the scene that a shape belongs to: contact sums and tables group shapes by it, pictures colour
/// them by it.
enum class Part { palm, thumb, index, middle, ring, little, object, ground, mechanism };

enum class Side { right, left };

/// One rigid body. The body frame has its origin at the centre of mass.
struct Body {
  std::string name;                              ///< unique, e.g. `right.index_proximal`
  double mass = 0;                               ///< [kg], > 0 (the world: 0)
  Mat3 inertia = Mat3::Zero();                   ///< about the centre of mass in body axes [kg m^2]
  Pose zero_pose;                                ///< X_WB with every joint coordinate at zero
  Vec3 initial_velocity = Vec3::Zero();          ///< of the centre of mass, in world axes [m/s]
  Vec3 initial_angular_velocity = Vec3::Zero();  ///< in world axes [rad/s]
  /// Moves as a Drive prescribes, or is fixed if it has none; acts on other bodies as an infinite mass.
  bool kinematic = false;
};

enum class ShapeKind { box, capsule, cylinder, sphere, convex_mesh, plane };

/// A shape fixed to a body. Capsules and cylinders are along local z; a plane is z = 0 with the solid below.
struct Shape {
  std::string name;
  ShapeKind kind = ShapeKind::sphere;
  int body = kWorld;
  Pose pose;                  ///< X_BS, shape frame (origin at the shape's centre) in the body frame
  double radius = 0;          ///< capsule, cylinder, sphere [m]
  double length = 0;          ///< capsule: between the cap centres; cylinder: full height [m]
  Vec3 edges = Vec3::Zero();  ///< box: full edge lengths [m]
  std::shared_ptr<const ConvexMesh> mesh;  ///< convex_mesh; the shape's centre is its centroid
  int group = 0;                           ///< index into `Model::groups`
  int material = 0;                        ///< index into `Model::materials`
  Part part = Part::object;
  std::optional<std::uint32_t> colour = {};  ///< in pictures: sRGB 0xRRGGBB; absent: that of its part
};

enum class JointKind {
  hinge,      ///< one rotation
  universal,  ///< two rotations: the first axis fixed in the parent, the second in the child
  ball,       ///< free rotation about a point
  slider,     ///< one translation
};

/// What the child of a joint can do against the parent. Its coordinates are in this order. A type of joint is
/// a row of kJointTypes, and what an engine or a format needs for it: docs/inside.md lists the files.
struct JointType {
  std::string_view name;  ///< in files and in Python
  int slides = 0;         ///< 1: along axis 0, which is fixed in the parent
  int turns = 0;  ///< about no axis, about one, about two that are perpendicular, or 3: freely, without axes

  /// Whether its axes have to be perpendicular.
  bool perpendicular() const { return turns == 2; }
  /// Its axes: each has a coordinate, a name and perhaps stops and tissue.
  std::size_t axes() const { return static_cast<std::size_t>(slides + (turns < 3 ? turns : 0)); }
};

/// By JointKind.
inline constexpr JointType kJointTypes[] = {
    {"hinge", 0, 1}, {"universal", 0, 2}, {"ball", 0, 3}, {"slider", 1, 0}};

inline const JointType& type_of(JointKind kind) { return kJointTypes[static_cast<std::size_t>(kind)]; }
inline int dof_count(JointKind kind) { return type_of(kind).slides + type_of(kind).turns; }

/// Limits of one joint coordinate.
struct Stop {
  double low = 0;          ///< [rad] or [m], below `high`
  double high = 0;         ///< [rad] or [m]
  double restitution = 0;  ///< 0..1
  double motor_share = 1;  ///< of the torque of a motor that drives off the stop, 0..1; of engine ode alone
  bool stiff = false;      ///< narrower than the joint of a hand of this model: poses may lie beyond it

  /// What files say beside the range (core/fields.h).
  template <class Visit>
  static void fields(Visit&& visit) {
    visit("bounce", &Stop::restitution, Quantity{Dimension::none, 0, 1});
    visit("fudge_factor", &Stop::motor_share, Quantity{Dimension::none, 0, 1});
  }
};

/// Linear passive tissue across one joint coordinate: torque = -stiffness (q - rest) - damping qdot.
struct Tissue {
  double stiffness = 0;  ///< [N m/rad] or [N/m]
  double damping = 0;    ///< [N m s/rad] or [N s/m]
  double rest = 0;       ///< [rad] or [m]

  /// Of the axis of a hand (core/fields.h).
  template <class Visit>
  static void fields(Visit&& visit) {
    visit("stiffness", &Tissue::stiffness, Quantity{Dimension::rotational_stiffness, 0, 1e3}, Unsaid{});
    visit("damping", &Tissue::damping, Quantity{Dimension::rotational_damping, 0, 1e3}, Unsaid{});
    visit("rest", &Tissue::rest, Quantity{Dimension::angle, -M_PI, M_PI}, Unsaid{});
  }
};

/// One axis of a joint.
struct JointAxis {
  std::string name;           ///< e.g. `flexion`
  Vec3 axis = Vec3::UnitX();  ///< unit, in the joint's parent frame F; the second about which it turns in its
                              ///< child frame M
  std::optional<Stop> stop;
  std::optional<Tissue> tissue;
  double initial = 0;  ///< coordinate at the start [rad] or [m]
  double torque = 0;   ///< constant, along the coordinate, where actuation is on [N m] or [N]
};

/// The range of a joint that has grown stiff: narrow, not nothing, for engines and formats want low < high.
inline constexpr double kFusedRange = 2e-3;
inline bool fused(const JointAxis& axis) {
  return axis.stop && axis.stop->high - axis.stop->low < 1.01 * kFusedRange;
}

/// A joint. Frame F is fixed in the parent, M in the child; at zero coordinates they coincide. Hinge: R_FM =
/// Rot(axis0, q0). Universal: R_FM = Rot(axis0, q0) Rot(axis1, q1). Ball: R_FM free. Slider: p_FM = q0 axis0.
struct Joint {
  std::string name;  ///< unique, e.g. `right.index_mcp`
  JointKind kind = JointKind::hinge;
  int parent = kWorld;
  int child = 0;
  Pose parent_frame;            ///< X_PF
  Pose child_frame;             ///< X_CM
  std::vector<JointAxis> axes;  ///< as many as its type has
  int first_dof = 0;            ///< index of its first coordinate in vectors of `Model::dof_count()`
  bool closes_loop = false;     ///< its child is already the child of another joint

  const JointType& type() const { return type_of(kind); }
  /// Its child turns freely: the coordinates after a slide's are a rotation vector, without axes.
  bool spherical() const { return type().turns == 3; }
  /// Whether a coordinate is a length [m] rather than an angle [rad].
  bool slides(std::size_t coordinate) const { return coordinate < as_index(type().slides); }
  const char* unit(std::size_t coordinate) const { return slides(coordinate) ? "m" : "rad"; }
};

/// A named set of shapes that contact rules refer to.
struct ContactGroup {
  std::string name;
};

/// Two groups whose shapes are tested (a rule may name one twice), but not jointed or two immovable bodies.
struct ContactRule {
  int group_a = 0;
  int group_b = 0;
  std::optional<int> material = {};  ///< index into `Model::materials`; absent: the shapes' own, combined
};

/// A kinematic body that follows a timed trajectory of its joint centre frame.
struct Drive {
  int body = 0;
  Pose frame;         ///< X_BD: the driven frame D in the body frame
  PoseMotion motion;  ///< X_WD over time
};

/// The end of a finger.
struct Fingertip {
  std::string name;  ///< `right.index_tip`
  Part finger = Part::index;
  int body = kWorld;          ///< that the last segment is of
  Vec3 point = Vec3::Zero();  ///< in the body frame [m]
};

/// Indices of a hand's parts in the model.
struct HandIndex {
  std::string name;  ///< `right`, `left`, or with a number if a scene has several of a side
  Side side = Side::right;
  int palm = 0;                 ///< body
  Pose wrist_frame;             ///< X_PH: hand frame H (origin at the wrist joint centre) in the palm body
  std::vector<int> bodies;      ///< palm first, then segments
  std::optional<int> forearm;   ///< body; the palm hangs on it
  std::vector<int> palm_parts;  ///< bodies that are parts of the palm beside `palm`: metacarpals
  std::vector<Fingertip> fingertips;
  std::vector<int> joints;   ///< finger joints, and those of wrist and forearm if it has them
  std::optional<int> rail;   ///< slider joint of the palm, if it has one
  std::vector<int> muscles;  ///< in Model::muscles
  std::vector<int> bands;    ///< in Model::bands
};

/// Indices of an object's parts in the model.
struct ObjectIndex {
  std::string name;
  std::optional<int> body;  ///< absent: it does not move
  std::vector<int> shapes;
};

/// Everything a scene simulates.
struct Model {
  Vec3 gravity = {0, 0, -9.80665};  ///< [m/s^2]; acts only if the gravity effect is on
  std::vector<Body> bodies;         ///< [0] is the world
  std::vector<Joint> joints;
  std::vector<Shape> shapes;
  std::vector<Material> materials;
  std::vector<ContactGroup> groups;
  std::vector<ContactRule> contact_rules;  ///< empty: no contact at all
  std::vector<Drive> drives;
  std::vector<HandIndex> hands;
  std::vector<ObjectIndex> objects;
  std::vector<Muscle> muscles;  ///< those in effect
  std::vector<Band> bands;      ///< those in effect

  int dof_count() const;
  /// For each shape: the index in `objects` of the object that it belongs to, if any.
  std::vector<std::optional<std::size_t>> objects_of_shapes() const;
  /// Index of a new group.
  int add_group(std::string name);
};

/// Adds the world body to an empty model.
Model make_model();

}  // namespace handsim::model
