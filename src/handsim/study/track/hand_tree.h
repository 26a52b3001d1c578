// Points and directions on the segments of a hand, with their derivatives, as functions of the joint angles.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "handsim/hand/build.h"
#include "handsim/model/kinematics.h"

namespace handsim::study {

/// Wrist pose and angles.
struct HandPose {
  Pose wrist;                  ///< X_WH
  std::vector<double> angles;  ///< [rad], at the indices of HandTree::axes()
};

/// A point on a segment, or the orientation of a sensor on it.
struct Feature {
  enum class Kind { point, orientation };
  Kind kind = Kind::point;
  std::string name;                    ///< of the channel in the recording
  std::optional<std::size_t> segment;  ///< row in the hand model's segments; absent: the palm
  Vec3 at = Vec3::Zero();              ///< in the segment's frame [m]
  Quat rotation = Quat::Identity();    ///< q_SegmentSensor
  /// Added to `at`: x and z by the segment's radius, y by its length; of the palm by hand breadth, hand
  /// length and hand thickness.
  Vec3 shares = Vec3::Zero();
  Vec3 spread = Vec3::Zero();  ///< standard deviation of the shares between trackers and people
  bool base = false;           ///< on the palm or at a joint of it: hardly moves against it
  /// The point at the other end of a bone of the tracker, whose segment is `bone`: its direction counts, too.
  std::optional<std::size_t> from;
  std::size_t bone = 0;
  double arm = 0;  ///< a bone that is turned by 1 rad counts as a point that is this far off [m]
};

/// An axis of the hand's joints.
struct TreeAxis {
  std::string name;          ///< `index_mcp.flexion`
  double low = 0, high = 0;  ///< [rad]
  bool flexion = false;
};

class HandTree {
 public:
  /// @param hand right hand as built; @param side mirrors it.
  HandTree(const hand::HandSpec& spec, const hand::BuiltHand& hand, model::Side side);

  const std::vector<TreeAxis>& axes() const { return axes_; }
  model::Side side() const { return side_; }
  /// Number of parameters: position [m], turn [rad], angles [rad].
  std::size_t size() const { return 6 + axes_.size(); }

  /// Lets stops give way by this much [rad].
  void open(double by) {
    for (TreeAxis& axis : axes_) axis.low -= by, axis.high += by;
  }
  /// A pose after a step of its parameters, the turn in world axes; angles stay within their stops.
  HandPose moved(const HandPose& from, const Eigen::Ref<const Eigen::VectorXd>& step) const {
    return within_stops(moved_freely(from, step));
  }
  /// The same, beyond the stops, too.
  HandPose moved_freely(const HandPose& from, const Eigen::Ref<const Eigen::VectorXd>& step) const;
  /// Angles beyond a stop are set to it.
  HandPose within_stops(HandPose pose) const;
  /// Places the segments: what follows is at these angles.
  void place(std::span<const double> angles);
  /// Position of a feature's point in the hand frame [m], at the last placed angles.
  Vec3 point(const Feature& feature) const { return pose(feature).p; }
  /// Orientation of a feature's sensor in the hand frame.
  Quat orientation(const Feature& feature) const { return pose(feature).q; }
  /// Derivative of a feature's point by its shares, in the hand frame [m], at the last placed angles.
  Mat3 by_shares(const Feature& feature) const;
  /// Jacobian of a feature's point by the angles, in the hand frame.
  model::Jacobian jacobian(const Feature& feature) const;
  struct Capsule {
    std::string name;
    Vec3 at, along;  ///< centre, and from there to the centre of a cap
    double radius;
  };
  /// All of the hand, in the hand frame, at the last placed angles.
  std::vector<Capsule> capsules() const;
  /// How deep a part of the thumb lies in one of the palm, and what that is by the angles.
  struct Inside {
    double depth = 0;  ///< [m]
    Eigen::RowVectorXd by_angles;
  };
  /// Of pairs that may touch; fixed for a hand.
  std::size_t pairs() const { return pairs_.size(); }
  /// Of one of them, at the last placed angles; nothing where it is less than `least` [m].
  std::optional<Inside> inside(std::size_t pair, double least) const;

 private:
  /// The frame of the palm or of a segment, fixed to a body of the model.
  struct Frame {
    int body = 0;
    Pose in_body;
    Vec3 size;  ///< [m] by a share of 1
  };
  const Frame& frame(const Feature& feature) const {
    return frames_[feature.segment ? *feature.segment + 1 : 0];
  }
  Pose pose(const Feature& feature) const;
  Capsule capsule(const model::Shape& shape) const;
  void find_pairs(const hand::HandSpec& spec, const hand::BuiltHand& hand);

  model::Side side_;
  model::Model model_;  ///< the hand on a fixed palm, its frame at the origin of the world
  model::State state_;
  std::vector<Frame> frames_;  ///< of the palm, then of the segments
  std::vector<TreeAxis> axes_;
  std::vector<std::pair<std::size_t, std::size_t>> pairs_;  ///< capsules of thumb and palm, by their shapes
};

/// The 21 keypoints of camera trackers, in their usual order: wrist, then from the thumb to the little finger
/// the joints from the base to the tip (thumb: CMC, MCP, IP, tip; fingers: MCP, PIP, DIP, tip).
/// @throws Error (input) for a hand model without these five fingers.
std::vector<Feature> keypoints(const hand::HandSpec& spec, const hand::BuiltHand& hand);
/// Names of the keypoints: `wrist`, `thumb_cmc`, ... `little_tip`.
std::vector<std::string> keypoint_names();

}  // namespace handsim::study
