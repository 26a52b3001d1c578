// Reads joint angles over time from a CSV table or an OpenSim motion (.mot, .sto) as trajectories of hands.
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
/// An angle beyond its range by at most this much is moved to the stop, with a warning [rad].
inline constexpr double kMotionRangeTolerance = 0.5 * kDegree;

/// The content of a motion file.
struct MotionTable {
  std::string file;
  std::vector<std::string> names;  ///< of the columns after time, e.g. `right.index_mcp.flexion`
  std::vector<double> times;       ///< [s], increasing
  std::vector<double> values;      ///< row after row, size times * names [rad]
  std::vector<int> lines;          ///< of the rows in the file
  int header_line = 1;

  double at(std::size_t row, std::size_t column) const { return values[row * names.size() + column]; }
};

/// CSV: first line `time[s],NAME[rad],...`, units rad (default) or deg; columns in other units (those of
/// trajectory.csv) are ignored. .mot and .sto: the OpenSim header with nRows, nColumns, inDegrees,
/// endheader, then labels and rows separated by white space. Coordinate paths (`/jointset/.../NAME/value`)
/// count as NAME.
/// @throws Error (input) with line and column of the first twenty defects: missing columns, rows of the wrong
/// length, invalid numbers, times that do not increase, a header that differs from the content, a file that
/// is not regular or too large.
MotionTable read_motion(const std::filesystem::path& path);

/// True for names that end in .csv, .mot or .sto.
bool is_motion_file(const std::string& name);

/// Trajectory of a hand: columns `HAND.joint.axis`, or `joint.axis` for every hand. Axes that are neither
/// driven nor in the table keep their start angle.
/// @param driven for each axis of the hand whether it must be in the table.
Trajectory motion_trajectory(const MotionTable& table, const HandAxes& hand, const std::vector<bool>& driven,
                             std::span<const double> start, Diagnostics& diagnostics);

}  // namespace handsim::control
