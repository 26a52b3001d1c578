// Fits the pose of a hand to features of one frame: least squares (Levenberg-Marquardt), the stops as bounds.
#pragma once

#include <optional>
#include <vector>

#include "handsim/study/track/hand_tree.h"

namespace handsim::study {

/// A measured feature; absent: not seen.
struct MeasuredPoint {
  std::optional<Vec3> point;        ///< world [m]
  std::optional<Quat> orientation;  ///< q_WorldSensor
  double weight = 1;                ///< of the point's residual: the root of its confidence

  bool seen() const { return point || orientation; }
};
using MeasuredFrame = std::vector<MeasuredPoint>;  ///< by feature

/// A turn of a sensor by 1 rad counts as much as a point that is this far off [m].
inline constexpr double kSensorArm = 0.05;

struct FitResult {
  HandPose pose;
  double rms = 0;  ///< of the distances of all points used, sensors by kSensorArm [m]
  std::vector<std::optional<double>> distances;  ///< by feature [m]; absent: not measured or rejected
  std::vector<bool> rejected;                    ///< by feature: far from the rest, not used

  bool rejects() const { return std::ranges::find(rejected, true) != rejected.end(); }
};

/// A thumb lies in the palm as deep as skin gives way, and deeper with this deviation: both chosen [m].
inline constexpr double kGive = 1e-3, kSkin = 0.5e-3;

/// Residuals [m] at a pose, times the points' weights, and their derivatives by position, turn in world axes,
/// angles; those of unused features are 0. Three of each feature, then three of the bone that
/// ends at each, then one of each of HandTree::pairs().
struct Rows {
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
};

class PoseFit {
 public:
  PoseFit(HandTree tree, std::vector<Feature> features)
      : tree_(std::move(tree)), features_(std::move(features)) {}

  /// The thumb stays out of the palm as firmly as points that are off by so much in a coordinate let it [m];
  /// points that are exact (0, at first) say themselves where it is.
  void set_noise(double noise) { firm_ = noise / kSkin; }

  const HandTree& tree() const { return tree_; }
  const std::vector<Feature>& features() const { return features_; }

  /// From a start pose. @param outlier points farther than this from the fit are left out, worst first [m].
  FitResult fit(const MeasuredFrame& frame, const HandPose& start, double outlier);
  /// Without a start pose: the wrist from the points of the palm, fingers from several postures.
  FitResult find(const MeasuredFrame& frame, double outlier);
  /// Distances at a pose.
  FitResult measure(const MeasuredFrame& frame, HandPose pose, std::vector<bool> rejected);
  /// HandTree::by_shares() of a feature at the pose of the last rows().
  Mat3 by_shares(std::size_t feature) const { return tree_.by_shares(features_[feature]); }
  /// At a pose, without the rejected features.
  Rows rows(const MeasuredFrame& frame, const HandPose& pose, const std::vector<bool>& rejected);

 private:
  HandPose solve(const MeasuredFrame& frame, HandPose pose, const std::vector<bool>& rejected);

  HandTree tree_;
  std::vector<Feature> features_;
  double firm_ = 0;
};

}  // namespace handsim::study
