// Tables over time in OpenSim's format: .mot (joint angles) and .sto (any quantities); angles in degrees,
// which inDegrees=yes in the header states. Each row is written to the disk at once.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "handsim/output/atomic_file.h"

namespace handsim::output {

struct MotionHead {
  std::string title;
  std::vector<std::string> names;  ///< names of the columns after time, without white space
  std::size_t most_rows = 0;       ///< upper bound of the number of rows; with fewer, blanks follow `nRows=N`
  bool degrees = true;             ///< angles are in degrees: inDegrees=yes; a table of torques alone: no
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

}  // namespace handsim::output
