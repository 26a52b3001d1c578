// The one table of a rollout study: a row for each rollout, columns that are known before the first. Its text
// is that of rollouts.csv; python/handsim/_rollouts.py collects rows and writes the files.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace handsim::study {

/// Nothing, a number or a text.
using Cell = std::variant<std::monostate, double, std::string>;

enum class ColumnRole {
  index,    ///< the rollout's number
  drawn,    ///< what was varied
  outcome,  ///< held, how and when it ended, error, state hash
  figure,
  asked,  ///< a figure that the study names as an outcome
};

struct Column {
  std::string name;  ///< with its unit: `grasp_slip[m/s]`
  ColumnRole role = ColumnRole::figure;
  bool text = false;

  bool operator==(const Column&) const = default;
};

/// Rows of curves for bands, about.
constexpr long kBandRows = 400;

/// The states of one rollout, in the columns of trajectory.csv, or other curves; the time first.
struct TimeSeries {
  std::vector<std::string> columns;
  std::vector<double> values;  ///< row by row
};

struct RolloutRow {
  long rollout = 0;
  std::vector<Cell> cells;  ///< in the order of the columns
  std::optional<TimeSeries> trajectory;
  TimeSeries curves;  ///< for bands
};

/// The head of a table, which all parts of a study share.
struct TableHead {
  std::string title;
  long size = 0;  ///< rollouts of the whole study
  std::string seed;
  std::vector<Column> columns;
  /// The origin, on which results depend: study and scene files, handsim's commit, the engine and the
  /// mathematics library.
  std::vector<std::string> origin;
};

/// One row of CSV; a number as the shortest text that reads back as the same.
std::string csv_row(const TableHead& head, const RolloutRow& row);
std::string csv_head(const TableHead& head);

}  // namespace handsim::study
