// Makes trajectories of a hand from the angles of a motion file.
#pragma once

#include "handsim/control/hand_axes.h"
#include "handsim/control/motion_file.h"
#include "handsim/control/motion_names.h"
#include "handsim/control/trajectory.h"

namespace handsim::control {

/// An angle beyond its range by at most this much is moved to the stop, with a warning [rad].
inline constexpr double kMotionRangeTolerance = 0.5 * kDegree;

/// Trajectory of a hand: columns `HAND.joint.axis`, or `joint.axis` for every hand, after the names of
/// `options` are replaced. An axis without a column follows its coupling, if it has one; otherwise it keeps
/// its start angle, with a warning if it is driven. Problems: no column of this hand, angles beyond their
/// range without `options.clamp` (the first five places), a filter whose cut-off is not below half the rate.
/// @param driven for each axis of the hand whether a controller drives it.
Trajectory motion_trajectory(const MotionTable& table, const HandAxes& hand, const std::vector<bool>& driven,
                             std::span<const double> start, const MotionOptions& options,
                             Diagnostics& diagnostics);

}  // namespace handsim::control
