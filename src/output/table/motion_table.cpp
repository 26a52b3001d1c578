#include "handsim/output/table/motion_table.h"

#include <cassert>
#include <iterator>

#include <fmt/format.h>

#include "handsim/core/text.h"

namespace handsim::output {

namespace {

constexpr std::size_t kFlushAt = 1U << 18U;

}  // namespace

MotionTableWriter::MotionTableWriter(const std::filesystem::path& path, const MotionHead& head)
    : file_(path), columns_(head.names.size()), rows_text_(std::to_string(head.most_rows)) {
  buffer_ = printable(head.title, 4 * head.title.size()) + "\nversion=1\nnRows=";
  rows_at_ = static_cast<long>(buffer_.size());
  buffer_ += fmt::format("{}\nnColumns={}\ninDegrees=yes\nendheader\ntime", rows_text_, columns_ + 1);
  for (const std::string& name : head.names) buffer_ += "\t" + name;
  buffer_ += '\n';
}

void MotionTableWriter::add(double time, std::span<const double> values) {
  assert(values.size() == columns_);
  ++rows_;
  fmt::format_to(std::back_inserter(buffer_), "{:.12g}", time);
  for (const double value : values) fmt::format_to(std::back_inserter(buffer_), "\t{}", value);
  buffer_ += '\n';
  if (buffer_.size() < kFlushAt) return;
  file_.write(buffer_);
  buffer_.clear();
}

void MotionTableWriter::finish() {
  file_.write(buffer_);
  buffer_.clear();
  // A run that ends early has fewer rows than were foreseen.
  std::string rows = std::to_string(rows_);
  assert(rows.size() <= rows_text_.size());
  rows.resize(rows_text_.size(), ' ');
  if (rows != rows_text_) file_.overwrite(rows_at_, rows);
  file_.commit();
}

}  // namespace handsim::output
