#include "handsim/study/rollouts/rollout_table.h"

#include "handsim/core/units.h"
#include "handsim/study/report.h"

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

}  // namespace

std::string csv_head(const TableHead& head) {
  std::string out;
  for (const Column& column : head.columns) out += (out.empty() ? "" : ",") + field(column.name);
  return out + "\n";
}

std::string csv_row(const TableHead& head, const RolloutRow& row) {
  std::string out;
  for (std::size_t i = 0; i < head.columns.size(); ++i) {
    if (i > 0) out += ',';
    out += field(row.cells[i]);
  }
  return out + "\n";
}

}  // namespace handsim::study
