// Reads the poses of a wrist over time from a table.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "handsim/model/motion.h"

namespace handsim::control {

/// Poses of a hand's wrist over time from the same kinds of files: columns `x[m]`, `y[m]`, `z[m]`, and for
/// the rotation `qw`, `qx`, `qy`, `qz`, or an axis `axis.x`, `axis.y`, `axis.z` and its `angle[deg]`, or a
/// rotation vector `rx[deg]`, `ry[deg]`, `rz[deg]`, or none; each alone or as `HAND.wrist.x[m]`. Other
/// columns are ignored. Samples are joined by a spline.
/// @param hand `right`, `left`, ... @param filter cut-off of a low-pass [Hz] (low_pass); absent: as recorded.
/// @throws Error (input) as read_motion, for missing columns, bad quaternions and axes, too high a cut-off.
model::PoseMotion read_pose_table(const std::filesystem::path& path, const std::string& hand,
                                  const std::optional<double>& filter);

}  // namespace handsim::control
