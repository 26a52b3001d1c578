#include "handsim/study/rollouts/rollout_table.h"

#include <algorithm>
#include <bit>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/units.h"
#include "handsim/study/report.h"
#include "handsim/study/statistics.h"

namespace handsim::study {

namespace {

/// Text of a column, in quotes only where CSV needs them.
std::string field(const std::string& text) {
  return text.find_first_of(",\"\n") == std::string::npos ? text : quoted(text);
}

std::string field(const Cell& cell) {
  if (const double* number = std::get_if<double>(&cell)) return number_text(*number);
  if (const auto* text = std::get_if<std::string>(&cell)) return field(*text);
  return "";
}

// Bits: a figure may be infinite.
void save_number(ArchiveWriter& out, double value) { out.word(std::bit_cast<std::uint64_t>(value)); }
double read_number(ArchiveReader& in) { return std::bit_cast<double>(in.word()); }

}  // namespace

std::size_t TableHead::column(const std::string& name) const {
  for (std::size_t i = 0; i < columns.size(); ++i)
    if (columns[i].name == name) return i;
  throw input_error("rollouts", "a table without " + name, "one with it");
}

std::string csv_head(const TableHead& head) {
  std::string out;
  for (const Column& column : head.columns) out += (out.empty() ? "" : ",") + field(column.name);
  return out + "\n";
}

std::string csv_row(const TableHead& head, const Row& row) {
  std::string out;
  for (std::size_t i = 0; i < head.columns.size(); ++i) {
    if (i > 0) out += ',';
    out += field(row.cells[i]);
  }
  return out + "\n";
}

void save(ArchiveWriter& out, const TableHead& head) {
  out(head.title);
  out(head.size);
  out(head.seed);
  out.list(head.columns, [](ArchiveWriter& to, const Column& column) {
    to(column.name);
    to(static_cast<int>(column.role));
    to(column.text);
  });
  out(head.origin);
}

TableHead read_head(ArchiveReader& in) {
  TableHead out;
  in(out.title);
  in(out.size);
  in(out.seed);
  in.list(out.columns, [](ArchiveReader& from, Column& column) {
    from(column.name);
    column.role = static_cast<ColumnRole>(from.count(4));
    from(column.text);
  });
  in(out.origin);
  return out;
}

std::string bands_csv(const std::vector<Trajectory>& curves) {
  const auto longer = [](const Trajectory& a, const Trajectory& b) {
    return a.values.size() < b.values.size();
  };
  const Trajectory& longest = *std::ranges::max_element(curves, longer);
  const std::size_t width = longest.columns.size();
  std::string out = field(longest.columns[0]);
  for (std::size_t c = 1; c < width; ++c) {
    const std::string& name = longest.columns[c];
    const std::size_t unit = std::min(name.find('['), name.size());
    for (const char* part : {".p5", ".p50", ".p95"})
      out += "," + field(name.substr(0, unit) + part + name.substr(unit));
  }
  std::vector<double> values;
  for (std::size_t row = 0; row < longest.values.size(); row += width) {
    out += "\n" + number_text(longest.values[row]);
    for (std::size_t c = 1; c < width; ++c) {
      values.clear();
      for (const Trajectory& each : curves)
        if (row + c < each.values.size()) values.push_back(each.values[row + c]);
      std::ranges::sort(values);
      for (const double share : {0.05, 0.5, 0.95}) out += fmt::format(",{:.7g}", quantile(values, share));
    }
  }
  return out + "\n";
}

void save(ArchiveWriter& out, const Row& row) {
  out(row.rollout);
  out.list(row.cells, [](ArchiveWriter& to, const Cell& cell) {
    to(cell.index());
    if (const double* number = std::get_if<double>(&cell)) save_number(to, *number);
    if (const auto* text = std::get_if<std::string>(&cell)) to(*text);
  });
  out(row.trajectory.has_value());
  if (!row.trajectory) return;
  out(row.trajectory->columns);
  out(row.trajectory->values.size());
  for (const double value : row.trajectory->values) save_number(out, value);
}

Row read_row(ArchiveReader& in) {
  Row out;
  in(out.rollout);
  in.list(out.cells, [](ArchiveReader& from, Cell& cell) {
    const std::uint64_t kind = from.count(2);
    if (kind == 1) cell = read_number(from);
    if (kind == 2) from(cell.emplace<std::string>());
  });
  bool recorded = false;
  in(recorded);
  if (!recorded) return out;
  out.trajectory.emplace();
  in(out.trajectory->columns);
  out.trajectory->values.resize(in.size());
  for (double& value : out.trajectory->values) value = read_number(in);
  return out;
}

}  // namespace handsim::study
