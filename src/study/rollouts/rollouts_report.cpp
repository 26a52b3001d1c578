// The files of a rollout study, and what its varied keys do to the verdict.
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/input_file.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/output_folder.h"
#include "handsim/output/table/gnuplot.h"
#include "handsim/study/report.h"
#include "handsim/study/rollouts/rollouts.h"
#include "handsim/study/rollouts/table_file.h"

namespace handsim::study {

namespace {

constexpr std::size_t kBins = 10;
/// Numbers that take at most so many values are plotted value by value.
constexpr std::size_t kFewValues = 12;

/// Rows that were judged, with what stands in one column.
template <class T>
struct Judged {
  std::vector<T> values;
  std::vector<double> held;
};

template <class T>
Judged<T> judged(const Table& table, std::size_t column) {
  Judged<T> out;
  const std::size_t verdict = table.head.column("held");
  for (const Row& row : table.rows) {
    const double* held = std::get_if<double>(&row.cells[verdict]);
    const T* value = std::get_if<T>(&row.cells[column]);
    if (!held || !value) continue;
    out.values.push_back(*value);
    out.held.push_back(*held);
  }
  return out;
}

struct Count {
  long held = 0, of = 0;

  void add(double verdict) { held += verdict != 0, ++of; }
};

/// The share held of the rows with a value, or with one in a range.
struct Bin {
  std::string label;
  double low = 0, middle = 0, high = 0;  ///< of the values in it
  Count count;
};

std::vector<Bin> bins_of_numbers(const Judged<double>& rows) {
  std::vector<std::size_t> order(rows.values.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::stable_sort(order,
                           [&](std::size_t a, std::size_t b) { return rows.values[a] < rows.values[b]; });
  std::map<double, Count> each;
  for (std::size_t i = 0; i < order.size() && each.size() <= kFewValues; ++i)
    each[rows.values[order[i]]].add(rows.held[order[i]]);
  std::vector<Bin> out;
  if (each.size() <= kFewValues) {
    for (const auto& [value, count] : each) out.push_back({"", value, value, value, count});
    return out;
  }
  for (std::size_t b = 0; b < kBins; ++b) {
    const std::size_t from = b * order.size() / kBins, to = (b + 1) * order.size() / kBins;
    Bin bin;
    bin.low = rows.values[order[from]], bin.high = rows.values[order[to - 1]];
    bin.middle = rows.values[order[(from + to) / 2]];
    for (std::size_t i = from; i < to; ++i) bin.count.add(rows.held[order[i]]);
    out.push_back(bin);
  }
  return out;
}

std::vector<Bin> bins_of_texts(const Judged<std::string>& rows) {
  std::map<std::string, Count> each;
  for (std::size_t i = 0; i < rows.values.size(); ++i) each[rows.values[i]].add(rows.held[i]);
  std::vector<Bin> out;
  for (const auto& [value, count] : each) {
    const auto at = static_cast<double>(out.size());
    out.push_back({value, at, at, at, count});
  }
  return out;
}

/// What one varied column does to the verdict.
struct KeyEffect {
  std::string name;
  bool text = false;
  std::optional<Estimate> correlation;  ///< of numbers
  std::vector<Bin> bins;
};

std::vector<KeyEffect> key_effects(const Table& table) {
  std::vector<KeyEffect> out;
  for (std::size_t i = 0; i < table.head.columns.size(); ++i) {
    const Column& column = table.head.columns[i];
    if (column.role != ColumnRole::drawn) continue;
    KeyEffect& effect = out.emplace_back(KeyEffect{column.name, column.text, {}, {}});
    if (column.text) {
      effect.bins = bins_of_texts(judged<std::string>(table, i));
    } else {
      const auto rows = judged<double>(table, i);
      effect.correlation = rank_correlation(rows.values, rows.held);
      effect.bins = bins_of_numbers(rows);
    }
  }
  return out;
}

Count held_of(const Table& table) {
  Count out;
  const auto rows = judged<double>(table, table.head.column("held"));
  for (const double held : rows.held) out.add(held);
  return out;
}

/// How many rows ended in each way.
std::map<std::string, long> endings(const Table& table) {
  std::map<std::string, long> out;
  const std::size_t column = table.head.column("ended");
  for (const Row& row : table.rows) ++out[std::get<std::string>(row.cells[column])];
  return out;
}

Json json_of(const std::optional<Estimate>& estimate) {
  if (!estimate) return nullptr;
  return {{"value", estimate->value}, {"low", estimate->low}, {"high", estimate->high}};
}

Json json_of(const Count& count) {
  return {{"held", count.held}, {"of", count.of}, {"share", json_of(share(count.held, count.of))}};
}

std::string csv_of(const Table& table) {
  std::string out = csv_head(table.head);
  for (const Row& row : table.rows) out += csv_row(table.head, row);
  return out;
}

std::string plot_data(const std::vector<KeyEffect>& effects) {
  std::string out;
  for (std::size_t k = 0; k < effects.size(); ++k) {
    out += fmt::format("$key{} << EOD\n", k);
    for (const Bin& bin : effects[k].bins)
      if (const auto estimate = share(bin.count.held, bin.count.of))
        out += fmt::format("{} {} {} {} {} {} \"{}\"\n", bin.middle, bin.low, bin.high, estimate->value,
                           estimate->low, estimate->high, output::plot_text(bin.label));
    out += "EOD\n";
  }
  return out;
}

/// A step of 1, 2 or 5 times a power of ten, of which three to seven are in a span.
double tick(double span) {
  const double power = std::pow(10, std::floor(std::log10(span / 3)));
  for (const double digit : {5.0, 2.0})
    if (span / 3 >= digit * power) return digit * power;
  return power;
}

std::vector<Plot> plots_of(const Table& table, const std::vector<KeyEffect>& effects) {
  const auto panels = static_cast<int>(effects.size());
  const int columns = panels == 1 ? 1 : panels <= 4 ? 2 : 3, rows = (panels + columns - 1) / columns;
  std::string commands = fmt::format("  set multiplot layout {},{} title '{}' noenhanced\n", rows, columns,
                                     output::plot_text(table.head.title));
  commands += "  set ylabel 'share held'\n  set yrange [-0.03:1.03]\n  set grid ytics\n  unset key\n";
  for (std::size_t k = 0; k < effects.size(); ++k) {
    const KeyEffect& effect = effects[k];
    commands += fmt::format("  set xlabel '{}' noenhanced\n", output::plot_text(effect.name));
    if (effect.bins.empty()) {
      commands += "  set multiplot next\n";
    } else if (effect.text) {
      commands += fmt::format(
          "  set xrange [-0.5:{}]\n  set xtics auto\n  plot $key{} using 1:4:5:6:xtic(7) with yerrorbars pt "
          "7 lc rgb '#1f5fa8'\n",
          static_cast<double>(effect.bins.size()) - 0.5, k);
    } else {
      const double low = effect.bins.front().low, high = effect.bins.back().high;
      const double margin = high > low ? 0.03 * (high - low) : 1;
      commands += fmt::format("  set xrange [{}:{}]\n  set xtics {}\n", low - margin, high + margin,
                              tick(2 * margin + high - low));
      commands += fmt::format(
          "  plot $key{0} using 1:4:2:3:5:6 with xyerrorbars pt 7 lc rgb '#1f5fa8', $key{0} using 1:4 with "
          "lines lc rgb '#1f5fa8'\n",
          k);
    }
  }
  return {
      {"rollouts", fmt::format("size {},{}", 480 * columns, 360 * rows), commands + "  unset multiplot\n"}};
}

std::string estimate_text(const std::optional<Estimate>& estimate) {
  return estimate ? fmt::format("{:.3f} ({:.3f} to {:.3f})", estimate->value, estimate->low, estimate->high)
                  : "-";
}

constexpr double kNormal95 = 1.959963984540054;  ///< quantile 0.975 of the standard normal distribution

}  // namespace

std::vector<std::string> rollout_files() {
  std::vector<std::string> out = report_files("rollouts", {"rollouts"});
  out.insert(out.end(), {"rollouts.h5", "summary.json"});
  return out;
}

std::string rollouts_summary(const Table& table) {
  Json out;
  out["title"] = table.head.title;
  out["rollouts"] = table.head.size;
  out["seed"] = table.head.seed;
  out["held"] = json_of(held_of(table));
  for (const auto& [word, count] : endings(table)) out["ended"][word] = count;
  for (const KeyEffect& effect : key_effects(table)) {
    Json& key = out["keys"][effect.name];
    if (!effect.text) key["rank_correlation"] = json_of(effect.correlation);
    for (const Bin& bin : effect.bins) {
      Json entry = json_of(bin.count);
      if (effect.text)
        entry["value"] = bin.label;
      else
        entry["from"] = bin.low, entry["to"] = bin.high;
      key["shares"].push_back(std::move(entry));
    }
  }
  out["table_hash"] = fmt::format("{:016x}", hash_bytes(csv_of(table)));
  out["origin"] = table.head.origin;
  return out.dump(2) + "\n";
}

std::string rollouts_screen(const Table& table) {
  const Count held = held_of(table);
  std::string out = fmt::format("{}\n  {} rollouts: ", table.head.title, table.head.size);
  std::vector<std::string> parts;
  for (const auto& [word, count] : endings(table)) parts.push_back(fmt::format("{} {}", count, word));
  out += fmt::format("{}\n  held: {} of {} judged, share {} with its 95 % interval\n", fmt::join(parts, ", "),
                     held.held, held.of, estimate_text(share(held.held, held.of)));
  out += fmt::format("  {:<44} {:<26} {}\n", "varied", "rank correlation with held", "share held");
  for (const KeyEffect& effect : key_effects(table)) {
    std::vector<std::string> shares;
    for (const Bin& bin : effect.bins)
      if (effect.text)
        shares.push_back(fmt::format("{} {:.3f}", bin.label, share(bin.count.held, bin.count.of)->value));
    if (!effect.text && !effect.bins.empty())
      for (const Bin* bin : {&effect.bins.front(), &effect.bins.back()})
        shares.push_back(fmt::format("{:.3g} to {:.3g}: {:.3f}", bin->low, bin->high,
                                     share(bin->count.held, bin->count.of)->value));
    out += fmt::format("  {:<44} {:<26} {}\n", effect.name, estimate_text(effect.correlation),
                       fmt::join(shares, ", "));
  }
  return out;
}

bool write_rollouts(const Table& table, const std::filesystem::path& out) {
  write_hdf5(table, out / "rollouts.h5");
  const std::vector<KeyEffect> effects = key_effects(table);
  Report report;
  report.csv = csv_of(table);
  report.data = plot_data(effects);
  report.plots = plots_of(table, effects);
  const bool plotted = write_report(out, "rollouts", report);
  output::write_file(out / "summary.json", rollouts_summary(table));
  return plotted;
}

StudyEnd merge_rollouts(const std::vector<std::filesystem::path>& folders, const StudyRun& run) {
  constexpr std::size_t kMostCommands = 1UL << 20U;
  const auto with_commands = std::ranges::find_if(folders, [](const std::filesystem::path& folder) {
    return std::filesystem::is_regular_file(folder / kStudyFile);
  });
  // Read before the folder is cleared, which may be one of the shards'.
  const std::string commands =
      with_commands == folders.end()
          ? ""
          : read_input_file(*with_commands / kStudyFile, "the commands of a study", kMostCommands);
  const Table table = merge_shards(folders);
  const output::OutputFolder folder(run.out, rollout_files());
  folder.clear();
  StudyEnd end{rollouts_screen(table)};
  end.plotted = write_rollouts(table, run.out);
  if (!commands.empty()) output::write_file(run.out / kStudyFile, commands);
  if (run.report) output::write_file(run.out / kPageFile, study_page(run.out));
  return end;
}

StudyCommands rollouts_commands(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                                std::optional<int> seed) {
  const std::string seeded = seed ? fmt::format(" --seed {}", *seed) : "";
  return {
      command_text({"rollouts", file.string()}, overrides) + seeded,
      {},
      {{"rollouts.csv", command_text({"run", file.string()}, overrides) + " --rollout {rollout}" + seeded}}};
}

std::optional<Estimate> share(long held, long of) {
  if (of <= 0) return std::nullopt;
  const auto n = static_cast<double>(of);
  const double p = static_cast<double>(held) / n, zz = kNormal95 * kNormal95;
  const double centre = (p + zz / (2 * n)) / (1 + zz / n);
  const double half = kNormal95 / (1 + zz / n) * std::sqrt(p * (1 - p) / n + zz / (4 * n * n));
  // The ends are 0 and 1 where none and all are held; rounding must not say otherwise.
  return Estimate{p, held == 0 ? 0 : centre - half, held == of ? 1 : centre + half};
}

std::vector<double> ranks(std::span<const double> values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  std::vector<double> out(values.size());
  for (std::size_t from = 0, to = 0; from < order.size(); from = to) {
    while (to < order.size() && values[order[to]] == values[order[from]]) ++to;
    for (std::size_t i = from; i < to; ++i) out[order[i]] = 0.5 * static_cast<double>(from + 1 + to);
  }
  return out;
}

std::optional<Estimate> rank_correlation(std::span<const double> x, std::span<const double> y) {
  if (x.size() < 4 || x.size() != y.size()) return std::nullopt;
  const std::vector<double> a = ranks(x), b = ranks(y);
  const auto n = static_cast<double>(a.size());
  const double mean = 0.5 * (n + 1);
  double ab = 0, aa = 0, bb = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ab += (a[i] - mean) * (b[i] - mean);
    aa += (a[i] - mean) * (a[i] - mean);
    bb += (b[i] - mean) * (b[i] - mean);
  }
  if (aa == 0 || bb == 0) return std::nullopt;
  const double r = std::clamp(ab / std::sqrt(aa * bb), -1.0, 1.0);
  if (std::abs(r) == 1) return Estimate{r, r, r};
  const double z = std::atanh(r), half = kNormal95 * std::sqrt((1 + 0.5 * r * r) / (n - 3));
  return Estimate{r, std::tanh(z - half), std::tanh(z + half)};
}

}  // namespace handsim::study
