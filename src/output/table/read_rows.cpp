#include "handsim/output/table/read_rows.h"

#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/input_file.h"
#include "handsim/core/text.h"

namespace handsim::output {

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
