#include "handsim/study/rollouts/outcome_effects.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace handsim::study {

namespace {

constexpr std::size_t kBins = 10;
/// Numbers that take at most so many values are told value by value.
constexpr std::size_t kFewValues = 12;

std::optional<Estimate> estimate_of(const std::vector<double>& outcomes, bool verdict) {
  if (!verdict) return mean_of(outcomes);
  return share(std::ranges::count_if(outcomes, [](double held) { return held != 0; }), std::ssize(outcomes));
}

/// Rows that have an outcome, with what stands in a column.
template <class T>
std::vector<std::pair<T, double>> rows_with(const Table& table, std::size_t column, std::size_t outcome) {
  std::vector<std::pair<T, double>> out;
  for (const RolloutRow& row : table.rows) {
    const double* result = std::get_if<double>(&row.cells[outcome]);
    const T* value = std::get_if<T>(&row.cells[column]);
    if (result && value && std::isfinite(*result)) out.emplace_back(*value, *result);
  }
  return out;
}

std::vector<Bin> bins_of(std::vector<std::pair<double, double>> rows) {
  std::ranges::stable_sort(rows, {}, [](const auto& row) { return row.first; });
  std::map<double, std::vector<double>> each;
  for (std::size_t i = 0; i < rows.size() && each.size() <= kFewValues; ++i)
    each[rows[i].first].push_back(rows[i].second);
  std::vector<Bin> out;
  if (each.size() <= kFewValues) {
    for (auto& [value, outcomes] : each) out.push_back({"", value, value, value, std::move(outcomes), {}});
    return out;
  }
  for (std::size_t b = 0; b < kBins; ++b) {
    const std::size_t from = b * rows.size() / kBins, to = (b + 1) * rows.size() / kBins;
    Bin& bin = out.emplace_back();
    bin.low = rows[from].first, bin.high = rows[to - 1].first;
    bin.middle = rows[(from + to) / 2].first;
    for (std::size_t i = from; i < to; ++i) bin.outcomes.push_back(rows[i].second);
  }
  return out;
}

std::vector<Bin> bins_of(const std::vector<std::pair<std::string, double>>& rows) {
  std::map<std::string, std::vector<double>> each;
  for (const auto& [value, outcome] : rows) each[value].push_back(outcome);
  std::vector<Bin> out;
  for (auto& [value, outcomes] : each) {
    const auto at = static_cast<double>(out.size());
    out.push_back({value, at, at, at, std::move(outcomes), {}});
  }
  return out;
}

/// Numbers, or the index of each text in their order. Every rollout has what was drawn for it.
Input input_of(const Table& table, std::size_t column, const std::vector<const RolloutRow*>& rows) {
  Input out{table.head.columns[column].name, {}, table.head.columns[column].text};
  std::map<std::string, double> numbers;
  if (out.categories)
    for (const RolloutRow* row : rows) numbers.emplace(std::get<std::string>(row->cells[column]), 0);
  double next = 0;
  for (auto& [text, number] : numbers) number = next++;
  for (const RolloutRow* row : rows)
    out.values.push_back(out.categories ? numbers.at(std::get<std::string>(row->cells[column]))
                                        : std::get<double>(row->cells[column]));
  return out;
}

}  // namespace

OutcomeEffects effects_on(const Table& table, std::size_t outcome) {
  OutcomeEffects out;
  out.name = table.head.columns[outcome].name;
  out.verdict = out.name == "held" || out.name.ends_with(".held");
  std::vector<const RolloutRow*> rows;
  for (const RolloutRow& row : table.rows)
    if (const double* value = std::get_if<double>(&row.cells[outcome]); value && std::isfinite(*value)) {
      rows.push_back(&row);
      out.values.push_back(*value);
    }
  out.all = estimate_of(out.values, out.verdict);
  std::vector<Input> inputs;
  for (std::size_t i = 0; i < table.head.columns.size(); ++i) {
    const Column& column = table.head.columns[i];
    if (column.role != ColumnRole::drawn) continue;
    inputs.push_back(input_of(table, i, rows));
    KeyEffect& key = out.keys.emplace_back(KeyEffect{column.name, column.text, {}, {}});
    key.bins = column.text ? bins_of(rows_with<std::string>(table, i, outcome))
                           : bins_of(rows_with<double>(table, i, outcome));
    if (!column.text) key.correlation = rank_correlation(inputs.back().values, out.values);
    for (Bin& bin : key.bins) bin.estimate = estimate_of(bin.outcomes, out.verdict);
  }
  out.variance = variance_shares(inputs, out.values);
  return out;
}

bool KeyEffect::levels() const {
  return text || std::ranges::all_of(bins, [](const Bin& bin) { return bin.low == bin.high; });
}

std::vector<const Bin*> KeyEffect::telling() const {
  std::vector<const Bin*> out;
  if (bins.empty()) return out;
  if (levels()) {
    for (const Bin& bin : bins) out.push_back(&bin);
    return out;
  }
  const Estimate &first = *bins.front().estimate, &last = *bins.back().estimate;
  const Bin* extreme = nullptr;
  double beyond = 0;
  for (std::size_t i = 1; i + 1 < bins.size(); ++i) {
    const Estimate& of = *bins[i].estimate;
    const double off =
        std::max(of.low - std::max(first.high, last.high), std::min(first.low, last.low) - of.high);
    if (off > beyond) beyond = off, extreme = &bins[i];
  }
  out.push_back(&bins.front());
  if (extreme) out.push_back(extreme);
  out.push_back(&bins.back());
  return out;
}

std::vector<OutcomeEffects> outcome_effects(const Table& table) {
  std::vector<OutcomeEffects> out = {effects_on(table, table.head.column("held"))};
  for (std::size_t i = 0; i < table.head.columns.size(); ++i)
    if (table.head.columns[i].role == ColumnRole::asked) out.push_back(effects_on(table, i));
  return out;
}

}  // namespace handsim::study
