// Builds a hand of a person and a hand model: bodies, joints, shapes and muscles of a right hand in its
// frame.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "handsim/hand/hand_file.h"

namespace handsim::hand {

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
