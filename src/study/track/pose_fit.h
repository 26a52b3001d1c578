// Fits the pose of a hand to features of one frame: least squares (Levenberg-Marquardt), the stops as bounds.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "handsim/study/track/hand_tree.h"

namespace handsim::study {

/// What was measured of a feature; absent: not seen.
struct MeasuredPoint {
  std::optional<Vec3> point;        ///< world [m]
  std::optional<Quat> orientation;  ///< q_WorldSensor
};

/// A turn of a sensor by 1 rad counts as much as a point that is this far off [m].
inline constexpr double kSensorArm = 0.05;

struct FitResult {
  HandPose pose;
  double rms = 0;             ///< of the distances of all points used, sensors by kSensorArm [m]
  double squares = 0;         ///< sum of the squared residuals [m^2]
  std::size_t residuals = 0;  ///< number of their components
  std::vector<std::optional<double>> distances;  ///< by feature [m]; absent: not measured or rejected
  std::vector<bool> rejected;                    ///< by feature: far from the rest, not used
};

/// Residuals [m] at a pose and their derivatives by its parameters; those of unused features are 0.
struct Rows {
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
};

/// Gradient and Gauss-Newton matrix of the squared residuals [m^2] by position, turn in world axes, angles.
struct Linearised {
  Eigen::VectorXd gradient;
  Eigen::MatrixXd matrix;
  double squares = 0;
  std::size_t residuals = 0;
};

class PoseFit {
 public:
  PoseFit(HandTree tree, std::vector<Feature> features);
  ~PoseFit();
  PoseFit(PoseFit&&) noexcept;

  const HandTree& tree() const;
  const std::vector<Feature>& features() const;

  /// From a start pose. @param outlier points farther than this from the fit are left out, worst first [m].
  FitResult fit(const std::vector<MeasuredPoint>& frame, const HandPose& start, double outlier);
  /// Without a start pose: the wrist from the points of the palm, fingers from several postures.
  FitResult find(const std::vector<MeasuredPoint>& frame, double outlier);
  /// Distances at a pose [m]; absent: not measured or rejected.
  std::vector<std::optional<double>> distances(const std::vector<MeasuredPoint>& frame, const HandPose& pose,
                                               const std::vector<bool>& rejected);
  /// At a pose, without the rejected features.
  Rows rows(const std::vector<MeasuredPoint>& frame, const HandPose& pose, const std::vector<bool>& rejected);
  Linearised linearise(const std::vector<MeasuredPoint>& frame, const HandPose& pose,
                       const std::vector<bool>& rejected);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace handsim::study
