#include "handsim/output/motion_table.h"

#include <cassert>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "handsim/core/text.h"
#include "handsim/output/atomic_file.h"

namespace handsim::output {

MotionTableWriter::MotionTableWriter(std::string title, std::vector<std::string> names)
    : title_(std::move(title)), names_(std::move(names)) {}

void MotionTableWriter::add(double time, std::span<const double> values) {
  assert(values.size() == names_.size());
  ++rows_;
  fmt::format_to(std::back_inserter(text_), "{:.12g}", time);
  for (const double value : values) fmt::format_to(std::back_inserter(text_), "\t{}", value);
  text_ += '\n';
}

void MotionTableWriter::write(const std::filesystem::path& path) const {
  std::string head = fmt::format("{}\nversion=1\nnRows={}\nnColumns={}\ninDegrees=yes\nendheader\ntime",
                                 printable(title_, 4 * title_.size()), rows_, names_.size() + 1);
  for (const std::string& name : names_) head += "\t" + name;
  write_file(path, head + "\n" + text_);
}

}  // namespace handsim::output
