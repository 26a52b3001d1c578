// Smooths fitted poses of consecutive frames: the likeliest motion by how well a frame determines each angle.
#pragma once

#include <functional>
#include <vector>

#include "handsim/study/track/pose_fit.h"

namespace handsim::study {

/// Spectral densities of a hand's accelerations as white noise: 20 rad/s^2 and 5 m/s^2 for 50 ms; chosen.
struct MotionPrior {
  double angle = 40;      ///< of joint angles [rad^2/s^3]
  double position = 2.5;  ///< of the wrist [m^2/s^3]
  double turn = 40;       ///< of the wrist [rad^2/s^3]
};

using RowsAt = std::function<Rows(std::size_t frame, const HandPose& at)>;

/// Minimises, over a correction of each frame's parameters, the sum of
///   the squared residuals of the features / noise^2  and
///   the squared changes of rate between frames / (density * time between them),
/// with one Gauss-Newton step from the given poses: a banded linear system. Angles stay within their stops.
/// @param times of the frames, increasing [s]. @param rows_at is asked once or twice for each frame.
/// @param noise standard deviation of a coordinate [m].
void smooth(const std::vector<double>& times, const RowsAt& rows_at, double noise, const MotionPrior& prior,
            const HandTree& tree, std::vector<HandPose>& poses);

}  // namespace handsim::study
