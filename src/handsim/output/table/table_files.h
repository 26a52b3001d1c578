// Tables over time as files. Writes OpenSim's format: .mot (joint angles) and .sto (any quantities), each row
// to the disk at once. Reads the tables that runs write: CSV, .mot and .sto.
#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/core/error.h"
#include "handsim/output/atomic_file.h"

namespace handsim::output {

struct MotionHead {
  std::string title;
  std::vector<std::string> names;  ///< names of the columns after time, without white space
  std::size_t most_rows = 0;       ///< upper bound of the number of rows; with fewer, blanks follow `nRows=N`
  bool degrees = true;             ///< angles are in degrees: inDegrees=yes in the header; torques alone: no
};

class MotionTableWriter {
 public:
  /// @throws Error (input) if the file cannot be created.
  MotionTableWriter(const std::filesystem::path& path, const MotionHead& head);

  /// Adds a row. @param values one for each name, angles in degrees. Times must increase.
  void add(double time, std::span<const double> values);
  /// Writes the number of rows into the header and gives the file its name.
  void finish();

 private:
  AtomicFile file_;
  std::size_t columns_;
  std::size_t rows_ = 0;
  std::string rows_text_;  ///< number of rows that the header has now
  long rows_at_ = 0;       ///< position of that number in the file [bytes]
};

/// A table of numbers, row by row.
struct NumberTable {
  std::vector<std::string> columns;
  std::vector<double> values;

  std::size_t rows() const { return columns.empty() ? 0 : values.size() / columns.size(); }
  double at(std::size_t row, std::size_t column) const { return values[row * columns.size() + column]; }
};

inline constexpr std::size_t kTableMostBytes = 4UL << 30U;  ///< Bytes of a table at most.

/// A table whose first column is an increasing time. @param finite all numbers, as float32. @throws Error
/// (input) at the line of a wrong field, a time that does not increase, a row of wrong length; as InputFile
NumberTable read_numbers(const std::filesystem::path& path, bool finite = true);

/// Calls `take` with the fields of each row after the head; returns the columns' names. CSV fields in double
/// quotes may have commas and doubled quotes. @throws Error (input) as read_numbers, and where take throws
std::vector<std::string> read_rows(
    const std::filesystem::path& path,
    const std::function<void(std::size_t line, std::span<const std::string_view> fields)>& take);

/// An error (input) at a line of a table.
Error row_error(const std::filesystem::path& path, std::size_t line, std::string got, std::string need);

/// A field as a number. @throws Error (input) at this line of the file.
double field_number(std::string_view field, const std::filesystem::path& path, std::size_t line);

}  // namespace handsim::output
