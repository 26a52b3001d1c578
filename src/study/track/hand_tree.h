// A hand as a tree of joints in double precision with exact derivatives: points and directions on its
// segments as functions of the wrist's pose and the joint angles.
#pragma once

#include <span>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "handsim/hand/build.h"

namespace handsim::study {

/// Wrist pose and angles. The rotation is exp(turn) * reference, so that its three parameters stay small.
struct HandPose {
  Pose wrist;                  ///< X_WH
  std::vector<double> angles;  ///< [rad], at the indices of HandTree::axes()
};

/// A point on a segment, or the orientation of a sensor on it.
struct Feature {
  enum class Kind { point, orientation };
  Kind kind = Kind::point;
  std::string name;                  ///< of the channel in the recording
  int segment = -1;                  ///< row in the hand model's segments; -1: the palm
  Vec3 at = Vec3::Zero();            ///< in the segment's frame [m]
  Quat rotation = Quat::Identity();  ///< q_SegmentSensor
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

  /// Places the segments. Call before measure().
  void place(std::span<const double> angles);
  /// Position of a feature's point in the hand frame [m], at the last placed angles.
  Vec3 point(const Feature& feature) const;
  /// Orientation of a feature's sensor in the hand frame.
  Quat orientation(const Feature& feature) const;
  /// Calls use(index of the angle, its axis as a unit vector, a point on the axis) for every axis that moves
  /// the segment, in the hand frame.
  template <class Use>
  void each_axis(int segment, const Use& use) const {
    for (int s = segment; s >= 0; s = links_[static_cast<std::size_t>(s)].parent) {
      const Link& link = links_[static_cast<std::size_t>(s)];
      for (std::size_t k = 0; k < link.axes.size(); ++k) use(link.first + k, link.world[k], link.frame.p);
    }
  }

 private:
  /// A segment and the joint at its start.
  struct Link {
    int parent = -1;
    Pose at;                  ///< of the segment's frame in the parent's, at zero angles
    std::vector<Vec3> axes;   ///< in the segment's frame at zero angles
    std::size_t first = 0;    ///< index of the first angle
    Pose frame;               ///< placed, in the hand frame
    std::vector<Vec3> world;  ///< axes, placed, in the hand frame
  };

  model::Side side_;
  std::vector<Link> links_;
  std::vector<TreeAxis> axes_;
};

/// The 21 keypoints of camera trackers, in their usual order: wrist, then from the thumb to the little finger
/// the joints from the base to the tip (thumb: CMC, MCP, IP, tip; fingers: MCP, PIP, DIP, tip).
/// @throws Error (input) for a hand model without these five fingers.
std::vector<Feature> keypoints(const hand::HandSpec& spec, const hand::BuiltHand& hand);
/// Their names: `wrist`, `thumb_cmc`, ... `little_tip`.
std::vector<std::string> keypoint_names();

}  // namespace handsim::study
