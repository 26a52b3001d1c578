// The one table of a rollout study: a row for each rollout, columns that are known before the first.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "handsim/core/archive.h"

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

/// The states of one rollout, in the columns of trajectory.csv, or other curves; the time first.
struct Trajectory {
  std::vector<std::string> columns;
  std::vector<double> values;  ///< row by row
};

struct Row {
  long rollout = 0;
  std::vector<Cell> cells;  ///< in the order of the columns
  std::optional<Trajectory> trajectory;
  Trajectory curves;  ///< for bands; the journal does not keep them
};

/// What all shards of a study share.
struct TableHead {
  std::string title;
  long size = 0;  ///< rollouts of the whole study
  std::string seed;
  std::vector<Column> columns;
  /// What results depend on: study and scene files, handsim's commit, the engine and the mathematics library.
  std::vector<std::string> origin;

  /// @throws Error (input) where there is no column of this name.
  std::size_t column(const std::string& name) const;
};

struct Table {
  TableHead head;
  std::vector<Row> rows;  ///< by number
};

/// One row of CSV; a number as the shortest text that reads back as the same.
std::string csv_row(const TableHead& head, const Row& row);
std::string csv_head(const TableHead& head);

/// At each time the 5th, 50th and 95th percentile of each curve, `NAME.p5[unit]`, of those that reach it.
/// @param curves with the same columns and times, some of which may end early
std::string bands_csv(const std::vector<Trajectory>& curves);

void save(ArchiveWriter& out, const TableHead& head);
void save(ArchiveWriter& out, const Row& row);
/// @throws Error (input) for bytes that are no such thing.
TableHead read_head(ArchiveReader& in);
Row read_row(ArchiveReader& in);

}  // namespace handsim::study
