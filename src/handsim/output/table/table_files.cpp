#include "handsim/output/table/table_files.h"

#include <cassert>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/input_file.h"
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

Error row_error(const std::filesystem::path& path, std::size_t line, std::string got, std::string need) {
  return Error(
      {Problem{Place{path.string(), static_cast<int>(line), 1}, "", std::move(got), std::move(need)}});
}

namespace {

/// Quotes are taken out of the line.
void split(std::string& line, char separator, std::vector<std::string_view>& fields) {
  fields.clear();
  bool in_quotes = false;
  char* to = line.data();
  const char *start = to, *end = to + line.size();
  for (const char* from = to; from != end; ++from)
    if (*from == '"' && !(in_quotes && from + 1 != end && from[1] == '"')) {
      in_quotes = !in_quotes;
    } else if (*from == separator && !in_quotes) {
      fields.emplace_back(start, to);
      start = ++to;
    } else {
      from += *from == '"' ? 1 : 0;
      *to++ = *from;
    }
  fields.emplace_back(start, to);
}

}  // namespace

double field_number(std::string_view field, const std::filesystem::path& path, std::size_t line) {
  double value = 0;
  const auto [end, failure] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (failure != std::errc() || end != field.data() + field.size())
    throw row_error(path, line, printable(field), "a number");
  return value;
}

std::vector<std::string> read_rows(
    const std::filesystem::path& path,
    const std::function<void(std::size_t, std::span<const std::string_view>)>& take) {
  InputFile file(path, "a table that a run wrote", kTableMostBytes);
  const bool storage = path.extension() != ".csv";
  const char separator = storage ? '\t' : ',';
  std::string text;
  std::size_t line = 0;
  if (storage)
    while (++line, file.line(text) && text != "endheader") {
    }
  ++line;
  file.line(text);
  std::vector<std::string_view> fields;
  split(text, separator, fields);
  const std::vector<std::string> columns(fields.begin(), fields.end());
  while (++line, file.line(text)) {
    split(text, separator, fields);
    if (fields.size() != columns.size())
      throw row_error(path, line, fmt::format("{} fields", fields.size()), fmt::format("{}", columns.size()));
    if (file.cut()) throw row_error(path, line, "a line without its end", "a whole table");
    take(line, fields);
  }
  return columns;
}

NumberTable read_numbers(const std::filesystem::path& path, bool finite) {
  NumberTable out;
  std::size_t width = 0;
  out.columns = read_rows(path, [&](std::size_t line, std::span<const std::string_view> fields) {
    for (const std::string_view field : fields) {
      const double value = field_number(field, path, line);
      // The page has float32.
      if ((finite || &field == fields.data()) && !std::isfinite(static_cast<float>(value)))
        throw row_error(path, line, printable(field), "a number of at most 38 digits");
      out.values.push_back(value);
    }
    const std::size_t now = out.values.size() - fields.size();
    if (width > 0 && !(out.values[now] > out.values[now - width]))
      throw row_error(path, line,
                      fmt::format("the time {:g} after {:g}", out.values[now], out.values[now - width]),
                      "times that increase");
    width = fields.size();
  });
  return out;
}

}  // namespace handsim::output
