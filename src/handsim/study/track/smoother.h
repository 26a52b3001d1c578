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
/// with Gauss-Newton steps from the given poses: banded linear systems, damped where a frame's part of the
/// sum rises. Angles stay within their stops: those that come beyond one are held at it as long as the sum
/// falls towards the outside (a primal-dual active set; Hintermüller, Ito & Kunisch 2002, SIAM J Optim
/// 13:865).
/// @param times of the frames, increasing [s]. @param rows_at is asked up to three times for each frame and
/// step.
/// @param noise standard deviation of a coordinate [m].
void smooth(const std::vector<double>& times, const RowsAt& rows_at, double noise, const MotionPrior& prior,
            const HandTree& tree, std::vector<HandPose>& poses);

}  // namespace handsim::study
