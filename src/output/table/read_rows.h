// Reads the tables that runs write: CSV, and OpenSim's .mot and .sto.
#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/core/error.h"

namespace handsim::output {

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
