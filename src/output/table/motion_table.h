// Columns over time as OpenSim reads them: .mot (joint angles) and .sto (any quantities); angles in degrees.
// Rows go to the disk as they come.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "handsim/output/atomic_file.h"

namespace handsim::output {

/// What stands above the rows.
struct MotionHead {
  std::string title;
  std::vector<std::string> names;  ///< of the columns after time, without white space
  std::size_t most_rows = 0;       ///< that will be added; fewer leave blanks after `nRows=` and their number
};

class MotionTableWriter {
 public:
  /// @throws Error (input) where the file cannot be made.
  MotionTableWriter(const std::filesystem::path& path, const MotionHead& head);

  /// A row. @param values one for each name, angles in degrees. Times must rise.
  void add(double time, std::span<const double> values);
  /// Gives the file its name; the header holds the number of rows.
  void finish();

 private:
  AtomicFile file_;
  std::size_t columns_;
  std::size_t rows_ = 0;
  std::string rows_text_;  ///< as it stands in the header
  long rows_at_ = 0;       ///< where
};

}  // namespace handsim::output
