// Reads joint angles, wrist poses or excitations of muscles over time from a CSV table or an OpenSim motion
// (.mot, .sto).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "handsim/core/yaml_reader.h"

namespace handsim::control {

inline constexpr std::size_t kMotionMaxBytes = 256U << 20U;
inline constexpr std::size_t kMotionMaxRows = 1'000'000;

struct MotionTable {
  std::string file;
  std::vector<std::string> names;  ///< of the columns after time, e.g. `right.index_mcp.flexion`
  std::vector<double> times;       ///< [s], increasing
  std::vector<double> values;      ///< row after row, size times * names: angles [rad], poses [m] and
                                   ///< quaternions, excitations 0 to 1
  std::vector<int> lines;          ///< of the rows in the file
  int header_line = 1;
  bool radians = false;  ///< no column is in degrees

  double at(std::size_t row, std::size_t column) const { return values[row * names.size() + column]; }
};

/// What the columns of a table are.
enum class TableContent { angles, poses, excitations };

/// Reads a table. CSV: first line `time[s],NAME[rad],...`, units rad (default) or deg; columns in other units
/// (those of trajectory.csv and control.sto) are ignored. .mot and .sto: the OpenSim header with nRows,
/// nColumns, inDegrees, endheader, then labels and rows separated by white space. Coordinate paths
/// (`/jointset/.../NAME/value`) count as NAME.
/// @throws Error (input) with line and column of the first twenty defects: missing columns, rows of the wrong
/// length, invalid numbers, times that do not increase, a header that differs from the content, a file that
/// is not regular or too large.
/// @param content columns that are kept; the others are ignored. Poses are in m, rad and without unit,
/// excitations without unit, `[]`, or `[rad]` as in older files.
MotionTable read_motion(const std::filesystem::path& path, TableContent content = TableContent::angles);

/// True for names that end in .csv, .mot or .sto.
bool is_motion_file(const std::string& name);

}  // namespace handsim::control
