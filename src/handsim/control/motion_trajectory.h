// Trajectories of a hand from the angles of a motion file. What other programs call the joint angles, and
// what a missing angle follows, is in files such as controllers/names_arms.yaml, and in `motion` of control.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "handsim/control/hand_axes.h"
#include "handsim/control/motion_file.h"
#include "handsim/control/trajectory.h"

namespace handsim::control {

/// angle of `axis` = sign * value in the file + offset.
struct ColumnName {
  std::string axis;   ///< `index_mcp.flexion`, or of one hand `right.index_mcp.flexion`
  double sign = 1;    ///< 1 or -1
  double offset = 0;  ///< [rad]
};

/// angle = ratio * angle of `axis` + offset.
struct Coupling {
  std::string axis;  ///< `index_pip.flexion`
  double ratio = 1;
  double offset = 0;  ///< [rad]
};

struct MotionNames {
  std::map<std::string, ColumnName> columns;  ///< by the file's name
  std::map<std::string, Coupling> couplings;  ///< by the axis that follows, used where a table lacks it
};

/// Options for reading the motion files of a scene.
struct MotionOptions {
  MotionNames names;
  bool clamp = false;            ///< moves angles beyond a stop to it and counts them; otherwise refused
  std::optional<double> filter;  ///< cut-off of a low-pass [Hz] (low_pass); absent: as recorded
  bool spline = false;           ///< joins the samples by a spline, for rates and accelerations
};

/// Reads a file of names; every defect goes into the diagnostics.
MotionNames read_motion_names(const YamlNode& node, const std::string& path, Diagnostics& diagnostics);

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

/// A low-pass filter of recorded motion without delay: Butterworth of second order, forwards and backwards:
/// order four, 1/sqrt(2) at the cut-off after both passes. The ends are extended by their point reflection,
/// so that the filter's start has little influence on them.
/// @param values samples of one quantity, `step` [s] apart. @param cutoff [Hz], below half the sampling rate
void low_pass(std::vector<double>& values, double step, double cutoff);

/// Filters rows of `width` quantities, by a spline if unequal in time; false (unchanged): too high a cut-off.
bool low_pass_rows(std::vector<double>& times, std::vector<double>& values, std::size_t width, double cutoff);

}  // namespace handsim::control
