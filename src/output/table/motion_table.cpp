#include "handsim/output/table/motion_table.h"

#include <cassert>

#include <fmt/format.h>

#include "handsim/core/text.h"

namespace handsim::output {

MotionTableWriter::MotionTableWriter(const std::filesystem::path& path, const MotionHead& head)
    : file_(path), columns_(head.names.size()), rows_text_(std::to_string(head.most_rows)) {
  std::string text = printable(head.title, 4 * head.title.size()) + "\nversion=1\nnRows=";
  rows_at_ = static_cast<long>(text.size());
  text += fmt::format("{}\nnColumns={}\ninDegrees={}\nendheader\ntime", rows_text_, columns_ + 1,
                      head.degrees ? "yes" : "no");
  for (const std::string& name : head.names) text += "\t" + name;
  file_.write(text + "\n");
}

void MotionTableWriter::add(double time, std::span<const double> values) {
  assert(values.size() == columns_);
  ++rows_;
  std::string row = fmt::format("{:.12g}", time);
  for (const double value : values) row += fmt::format("\t{}", value);
  file_.write(row + "\n");
}

void MotionTableWriter::finish() {
  // A run that ends early has fewer rows than most_rows.
  std::string rows = std::to_string(rows_);
  assert(rows.size() <= rows_text_.size());
  rows.resize(rows_text_.size(), ' ');
  if (rows != rows_text_) file_.overwrite(rows_at_, rows);
  file_.commit();
}

}  // namespace handsim::output
