// Columns over time as OpenSim reads them: .mot (joint angles in degrees) and .sto (any quantities).
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace handsim::output {

class MotionTableWriter {
 public:
  /// @param names of the columns after time, without white space. @param degrees whether the values that
  /// add() is
  ///        given in rad are written in degrees (`inDegrees=yes`); all columns are angles then.
  MotionTableWriter(std::string title, std::vector<std::string> names, bool degrees);

  /// A row. @param values one for each name. Times must rise.
  void add(double time, std::span<const double> values);
  /// Writes the file; the header holds the number of rows. @throws Error (input) where it cannot be written.
  void write(const std::filesystem::path& path) const;

 private:
  std::string title_;
  std::vector<std::string> names_;
  bool degrees_;
  std::size_t rows_ = 0;
  std::string text_;
};

}  // namespace handsim::output
