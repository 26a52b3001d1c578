#include "handsim/output/table/read_rows.h"

#include <charconv>
#include <fstream>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/text.h"

namespace handsim::output {

namespace {

Error row_error(const std::filesystem::path& path, std::size_t line, std::string got, std::string need) {
  return Error(
      {Problem{Place{path.string(), static_cast<int>(line), 1}, "", std::move(got), std::move(need)}});
}

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
  std::ifstream file(path);
  if (!file) throw input_error(path.string(), "no readable file", "a table that a run wrote");
  const bool storage = path.extension() != ".csv";
  const char separator = storage ? '\t' : ',';
  std::string text;
  std::size_t line = 0;
  if (storage)
    while (++line, std::getline(file, text) && text != "endheader") {
    }
  ++line;
  std::getline(file, text);
  std::vector<std::string_view> fields;
  split(text, separator, fields);
  const std::vector<std::string> columns(fields.begin(), fields.end());
  while (++line, std::getline(file, text)) {
    split(text, separator, fields);
    if (fields.size() != columns.size())
      throw row_error(path, line, fmt::format("{} fields", fields.size()), fmt::format("{}", columns.size()));
    take(line, fields);
  }
  return columns;
}

NumberTable read_numbers(const std::filesystem::path& path) {
  NumberTable out;
  out.columns = read_rows(path, [&](std::size_t line, std::span<const std::string_view> fields) {
    for (const std::string_view field : fields) out.values.push_back(field_number(field, path, line));
  });
  return out;
}

}  // namespace handsim::output
