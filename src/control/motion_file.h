// Joint angles over time from a CSV table or an OpenSim motion (.mot, .sto), as a program for hands.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "handsim/control/hand_axes.h"
#include "handsim/control/trajectory.h"
#include "handsim/core/yaml_reader.h"

namespace handsim::control {

inline constexpr std::size_t kMotionMaxBytes = 256U << 20U;
inline constexpr std::size_t kMotionMaxRows = 1'000'000;
/// A measured or simulated angle this little beyond its range is moved to its stop, counted and warned of
/// [rad].
inline constexpr double kMotionRangeTolerance = 0.5 * 0.017453292519943295;

/// The content of a motion file.
struct MotionTable {
  std::string file;
  std::vector<std::string> names;  ///< of the columns after time, e.g. `right.index_mcp.flexion`
  std::vector<double> times;       ///< [s], rising
  std::vector<double> values;      ///< row after row, size times * names [rad]
  std::vector<int> lines;          ///< of the rows in the file
  int header_line = 1;

  double at(std::size_t row, std::size_t column) const { return values[row * names.size() + column]; }
};

/// CSV: first line `time[s],NAME[rad],...`, units rad (default) or deg; columns in other units (those of
/// trajectory.csv) are left out. .mot and .sto: the OpenSim header with nRows, nColumns, inDegrees,
/// endheader, then labels and rows parted by white space. Coordinate paths (`/jointset/.../NAME/value`) count
/// as NAME.
/// @throws Error (input) with the line and column of every defect, the first twenty: missing columns, a row
/// too
///         short or long, numbers that are none, times that do not rise, a header that does not hold, a file
///         that is no regular one or too large.
MotionTable read_motion(const std::filesystem::path& path);

/// True for names that end in .csv, .mot or .sto.
bool is_motion_file(const std::string& name);

/// Trajectory of a hand: columns `HAND.joint.axis`, or `joint.axis` for every hand. Axes that are neither
/// driven nor in the table stay at their start.
/// @param driven for each axis of the hand whether it must be in the table.
Trajectory motion_trajectory(const MotionTable& table, const HandAxes& hand, const std::vector<bool>& driven,
                             std::span<const double> start, Diagnostics& diagnostics);

}  // namespace handsim::control
