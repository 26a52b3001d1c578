// The one table of a rollout study: a row for each rollout, columns that are known before the first. And its
// journal, what a study has computed so far, as a file: a killed study goes on from it, and shards are merged
// from theirs. Records of rows follow in the order in which they were done; a torn one at the end is left
// out.
#pragma once

#include <filesystem>
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
  TimeSeries curves;  ///< for bands; the journal does not keep them
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
  std::vector<RolloutRow> rows;  ///< by number
};

/// One row of CSV; a number as the shortest text that reads back as the same.
std::string csv_row(const TableHead& head, const RolloutRow& row);
std::string csv_head(const TableHead& head);

/// At each time the 5th, 50th and 95th percentile of each curve, `NAME.p5[unit]`, of those that reach it.
/// @param curves with the same columns and times, some of which may end early
std::string bands_csv(const std::vector<TimeSeries>& curves);

/// Rollouts k - 1, k - 1 + n, k - 1 + 2 n, ... of a study.
struct Shard {
  int k = 1, n = 1;

  bool whole() const { return n == 1; }
};

inline constexpr const char* kJournalName = "rollouts.journal";

/// Largest record of a journal [bytes]: a rollout that is written whole has to fit.
inline constexpr std::size_t kMostRecord = std::size_t{1} << 30U;

struct JournalContent {
  TableHead head;
  std::vector<RolloutRow> rows;  ///< in the order of the file
  std::size_t bytes = 0;         ///< that hold together
};

/// @throws Error (input) for a file that is no journal.
JournalContent read_journal(const std::filesystem::path& path);

class Journal {
 public:
  /// A new one. @throws Error (output) where it cannot be written.
  Journal(std::filesystem::path path, const TableHead& head);
  /// Goes on with one that was read.
  Journal(std::filesystem::path path, const JournalContent& content);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  /// Is on the disk when this returns. @throws Error (output) on a full disk; what was written before stays.
  void add(const std::vector<RolloutRow>& rows);

 private:
  void write(const std::string& record);
  [[noreturn]] void fail() const;

  std::filesystem::path path_;
  int file_ = -1;
};

}  // namespace handsim::study
