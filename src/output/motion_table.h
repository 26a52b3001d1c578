// Columns over time as OpenSim reads them: .mot (joint angles) and .sto (any
// quantities); angles in degrees.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace handsim::output {

class MotionTableWriter {
 public:
  /// @param names of the columns after time, without white space; angles are in degrees.
  MotionTableWriter(std::string title, std::vector<std::string> names);

  /// A row. @param values one for each name, angles in degrees. Times must rise.
  void add(double time, std::span<const double> values);
  /// Writes the file; the header holds the number of rows. @throws Error (input) where it cannot be written.
  void write(const std::filesystem::path& path) const;

 private:
  std::string title_;
  std::vector<std::string> names_;
  std::size_t rows_ = 0;
  std::string text_;
};

}  // namespace handsim::output
