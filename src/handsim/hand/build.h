// Builds a hand of a person and a hand model into a Model: a right one or its exact mirror image.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "handsim/hand/hand_file.h"

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
};

/// A row of the hand model as it was built.
struct BuiltSegment {
  Pose frame;                          ///< X_HS, origin at the proximal joint
  double length = 0, radius = 0;       ///< [m]; of a carrier 0
  int body = 0;                        ///< in BuiltHand::bodies; of a fixed segment its parent's
  std::optional<int> joint;            ///< in BuiltHand::joints; absent: fixed
  std::optional<std::size_t> capsule;  ///< in BuiltHand::shapes; absent: a carrier
};

/// One hand of a person, right, in the hand frame.
struct BuiltHand {
  HandSize size;
  double mass = 0;                     ///< of the whole hand [kg]; the bodies' masses sum to it
  double palm_volume = 0;              ///< [m^3]; space that several of its shapes share counts once
  std::vector<model::Body> bodies;     ///< [0] the palm, then the segments in their order; zero_pose is X_HB
  std::vector<model::Shape> shapes;    ///< those of the palm, then of the segments; `body` indexes `bodies`
  std::vector<model::Joint> joints;    ///< of the segments; `parent` and `child` index `bodies`
  std::vector<BuiltSegment> segments;  ///< as in the spec
  model::Joint wrist;                  ///< parent frame: the hand frame; child: the palm
  /// A body on a joint: of hands that hang on their wrist. Frames at zero angles from the hand frame.
  struct Forearm {
    model::Body body;
    model::Shape shape;  ///< its pose is in the body
    model::Joint joint;  ///< parent frame: from the hand frame
  };
  std::optional<Forearm> forearm;
  std::vector<int> palm_parts;               ///< in `bodies`: segments that are parts of the palm
  std::vector<model::Fingertip> fingertips;  ///< in `bodies`
  model::Material skin;
  HandMuscles muscles;         ///< none where the hand model has none
  std::vector<HandAxis> axes;  ///< that the muscles' arms number
};

/// @throws Error (input) for a tip shorter than its radius, a shape without size and impossible dimensions.
BuiltHand build_hand(const HandSpec& spec, const Person& person);

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

/// Breadth, length and thickness of the box about the palm's shapes [m].
Vec3 palm_box(const BuiltHand& hand);

/// Centre of mass and radii of gyration of the whole hand with straight fingers.
struct WholeHand {
  Vec3 centre_of_mass = Vec3::Zero();  ///< in the hand frame [m]
  HandInertiaShares shares;            ///< of the hand's length
};
WholeHand whole_hand(const BuiltHand& hand);

/// The elbow lies on the hand frame's y axis behind the wrist.
BuiltHand::Forearm forearm_of(const ForearmSpec& spec, const HandSize& size, const Person& person);

}  // namespace handsim::hand
