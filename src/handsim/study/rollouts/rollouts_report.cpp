// The files of a rollout study.
#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/input_file.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/output_folder.h"
#include "handsim/output/table/gnuplot.h"
#include "handsim/study/report.h"
#include "handsim/study/rollouts/outcome_effects.h"
#include "handsim/study/rollouts/rollouts.h"
#include "handsim/study/rollouts/table_file.h"

namespace handsim::study {

namespace {

/// If there are more outcomes, the screen shows one line for each, and only the first ones are plotted.
constexpr std::size_t kTold = 6;
/// If outcomes times keys exceed this number, the screen shows one line for each outcome.
constexpr std::size_t kMostLines = 30;

/// How many rows ended in each way.
std::map<std::string, long> endings(const Table& table) {
  std::map<std::string, long> out;
  const std::size_t column = table.head.column("ended");
  for (const RolloutRow& row : table.rows) ++out[std::get<std::string>(row.cells[column])];
  return out;
}

Json json_of(const std::optional<Estimate>& estimate) {
  if (!estimate) return nullptr;
  return {{"value", estimate->value}, {"low", estimate->low}, {"high", estimate->high}};
}

Json json_of(const std::vector<double>& verdicts) {
  const auto held = std::ranges::count_if(verdicts, [](double verdict) { return verdict != 0; });
  return {{"held", held}, {"of", verdicts.size()}, {"share", json_of(share(held, std::ssize(verdicts)))}};
}

/// Means of figures, shares of verdicts.
Json json_of(const OutcomeEffects& of, const std::vector<double>& values,
             const std::optional<Estimate>& all) {
  return of.verdict ? json_of(values) : Json{{"of", values.size()}, {"mean", json_of(all)}};
}

Json keys_json(const OutcomeEffects& of) {
  Json out;
  for (const KeyEffect& effect : of.keys) {
    Json& key = out[effect.name];
    if (!effect.text) key["rank_correlation"] = json_of(effect.correlation);
    for (const Bin& bin : effect.bins) {
      Json entry = json_of(of, bin.outcomes, bin.estimate);
      if (effect.text)
        entry["value"] = bin.label;
      else
        entry["from"] = bin.low, entry["to"] = bin.high;
      key[of.verdict ? "shares" : "means"].push_back(std::move(entry));
    }
  }
  return out;
}

Json variance_json(const OutcomeEffects& of) {
  Json out = Json::object();
  for (const VarianceShare& each : of.variance) out[each.of] = each.share;
  return out;
}

/// The 5th and the 95th percentile.
std::pair<double, double> middle_90(std::vector<double> values) {
  std::ranges::sort(values);
  return {quantile(values, 0.05), quantile(values, 0.95)};
}

Json outcome_json(const OutcomeEffects& of) {
  Json out = json_of(of, of.values, of.all);
  if (!of.verdict && !of.values.empty()) {
    const auto [low, high] = middle_90(of.values);
    out["percentile_5"] = low, out["percentile_95"] = high;
  }
  out["keys"] = keys_json(of);
  out["variance_shares"] = variance_json(of);
  return out;
}

std::string csv_of(const Table& table) {
  std::string out = csv_head(table.head);
  for (const RolloutRow& row : table.rows) out += csv_row(table.head, row);
  return out;
}

std::string plot_data(const std::vector<OutcomeEffects>& outcomes) {
  std::string out;
  int block = 0;
  for (const OutcomeEffects& of : outcomes)
    for (const KeyEffect& effect : of.keys) {
      out += fmt::format("$key{} << EOD\n", block++);
      for (const Bin& bin : effect.bins)
        if (bin.estimate)
          out += fmt::format("{} {} {} {} {} {} \"{}\"\n", bin.middle, bin.low, bin.high, bin.estimate->value,
                             bin.estimate->low, bin.estimate->high, output::plot_text(bin.label));
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

/// One panel: an outcome over a varied key.
std::string panel(const OutcomeEffects& of, const KeyEffect& effect, int block) {
  if (effect.bins.empty()) return "  set multiplot next\n";
  std::string out = fmt::format(
      "  set xlabel '{}' noenhanced\n  set ylabel '{}' noenhanced\n  set yrange {}\n",
      output::plot_text(effect.name),
      of.name == "held" ? "share held" : output::plot_text((of.verdict ? "share " : "mean ") + of.name),
      of.verdict ? "[-0.03:1.03]" : "[*:*]");
  if (effect.text)
    return out + fmt::format(
                     "  set xrange [-0.5:{}]\n  set xtics auto\n  plot $key{} using 1:4:5:6:xtic(7) with "
                     "yerrorbars pt 7 lc rgb '#1f5fa8'\n",
                     static_cast<double>(effect.bins.size()) - 0.5, block);
  const double low = effect.bins.front().low, high = effect.bins.back().high;
  const double margin = high > low ? 0.03 * (high - low) : 1;
  return out + fmt::format(
                   "  set xrange [{1}:{2}]\n  set xtics {3}\n  plot $key{0} using 1:4:2:3:5:6 with "
                   "xyerrorbars pt 7 lc rgb '#1f5fa8', $key{0} using 1:4 with lines lc rgb '#1f5fa8'\n",
                   block, low - margin, high + margin, tick(2 * margin + high - low));
}

/// Indices of keys, behind the differences between their bins; of more than `most` those with the largest.
std::vector<std::pair<double, std::size_t>> strongest(const OutcomeEffects& of, std::size_t most) {
  std::vector<std::pair<double, std::size_t>> out;
  for (const KeyEffect& key : of.keys) {
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (const Bin& bin : key.bins)
      if (bin.estimate) low = std::min(low, bin.estimate->value), high = std::max(high, bin.estimate->value);
    out.emplace_back(low - high, out.size());
  }
  if (out.size() > most) std::ranges::sort(out);
  out.resize(std::min(most, out.size()));
  return out;
}

/// A row of panels, or several, for each outcome; of many keys those with the largest differences.
std::vector<Plot> plots_of(const Table& table, const std::vector<OutcomeEffects>& outcomes) {
  constexpr std::size_t kMostPanels = 24;
  const std::size_t all = outcomes.front().keys.size();
  const std::size_t keys = std::min(all, std::max<std::size_t>(kMostPanels / outcomes.size(), 1));
  const bool dense = keys < all && keys < 3, wide = keys == 1 || (outcomes.size() > 1 && keys <= 6);
  const std::size_t columns = dense ? 4 : wide ? keys : std::min<std::size_t>(3, (keys + 4) / 3);
  const std::size_t each = dense ? keys : (keys + columns - 1) / columns * columns;
  const std::size_t rows = (each * outcomes.size() + columns - 1) / columns;
  std::string commands = fmt::format(
      "  set multiplot layout {},{} title '{}{}' noenhanced\n  set grid ytics\n  unset key\n  set zero "
      "1e-30\n",
      rows, columns, output::plot_text(table.head.title),
      keys < all ? fmt::format(": of {} keys the {} with the largest differences for each outcome", all, keys)
                 : "");
  for (std::size_t i = 0; i < outcomes.size(); ++i) {
    for (const auto& [_, key] : strongest(outcomes[i], keys))
      commands += panel(outcomes[i], outcomes[i].keys[key], static_cast<int>(i * all + key));
    for (std::size_t left = keys; left < each; ++left) commands += "  set multiplot next\n";
  }
  return {
      {"rollouts", fmt::format("size {},{}", 480 * columns, 360 * rows), commands + "  unset multiplot\n"}};
}

std::string estimate_text(const std::optional<Estimate>& estimate) {
  return estimate ? fmt::format("{:.3f} ({:.3f} to {:.3f})", estimate->value, estimate->low, estimate->high)
                  : "-";
}

/// What each varied key does to an outcome, as a table.
std::string keys_text(const OutcomeEffects& of) {
  std::string out =
      fmt::format("  {:<44} {:<26} {}\n", "varied", "rank correlation", of.verdict ? "share held" : "mean");
  for (const KeyEffect& effect : of.keys) {
    std::vector<std::string> bins;
    for (const Bin* bin : effect.telling())
      bins.push_back(fmt::format("{}: {:.3g}",
                                 effect.text ? bin->label
                                 : bin->low == bin->high
                                     ? fmt::format("{:.3g}", bin->low)
                                     : fmt::format("{:.3g} to {:.3g}", bin->low, bin->high),
                                 bin->estimate->value));
    out += fmt::format("  {:<44} {:<26} {}\n", effect.name, estimate_text(effect.correlation),
                       fmt::join(bins, ", "));
  }
  return out;
}

std::string variance_text(const OutcomeEffects& of) {
  return of.variance.empty() ? "" : fmt::format("  variance of {}: {}\n", of.name, owners_text(of.variance));
}

/// The owners by the last words of their keys.
std::string short_owners(std::vector<VarianceShare> shares) {
  for (VarianceShare& each : shares)
    for (std::size_t at; (at = each.of.find("hands.")) != std::string::npos;)
      each.of.erase(at, each.of.find("deviations.", at) == std::string::npos
                            ? 6
                            : each.of.find("deviations.", at) + 11 - at);
  return owners_text(shares);
}

/// An outcome in one line; nothing of one that does not vary.
std::string line_of(const OutcomeEffects& of, std::size_t width) {
  if (!of.varies()) return "";
  const auto [low, high] = middle_90(of.values);
  return fmt::format("  {:<{}} {:>11.4g}  {:<25} {}\n", of.verdict ? "share " + of.name : of.name, width,
                     of.all->value,
                     of.verdict ? fmt::format("({:.3f} to {:.3f}, 95 %)", of.all->low, of.all->high)
                                : fmt::format("{:.4g} to {:.4g}", low, high),
                     short_owners(of.variance));
}

}  // namespace

std::string held_text(const Table& table) {
  const OutcomeEffects held = effects_on(table, table.head.column("held"));
  if (!held.all) return "";
  std::map<std::string, long> ways = endings(table);
  return fmt::format("held in {:.0f} % of {} hands, {:.0f} to {:.0f} % (95 % interval){}",
                     100 * held.all->value, held.values.size(), 100 * held.all->low, 100 * held.all->high,
                     ways["refused"] > 0 ? fmt::format("; {} refused", ways["refused"]) : "");
}

std::string figure_rows(const std::string& head, const Table& table) {
  std::string out;
  for (const OutcomeEffects& of : outcome_effects(table)) {
    if (of.values.empty()) continue;
    const auto [low, high] = of.verdict ? std::pair(of.all->low, of.all->high) : middle_90(of.values);
    out += fmt::format("{},{},{},{:.7g},{:.7g},{:.7g},{}\n", head, quoted(of.name), of.values.size(),
                       of.all->value, low, high, quoted(short_owners(of.variance)));
  }
  return out;
}

std::vector<std::string> rollout_files() {
  std::vector<std::string> out = report_files("rollouts", {"rollouts"});
  out.insert(out.end(), {"rollouts.h5", "summary.json", kBandsFile});
  return out;
}

std::string rollouts_summary(const Table& table) {
  Json out;
  out["title"] = table.head.title;
  out["rollouts"] = table.head.size;
  out["seed"] = table.head.seed;
  const std::vector<OutcomeEffects> outcomes = outcome_effects(table);
  out["held"] = json_of(outcomes.front().values);
  for (const auto& [word, count] : endings(table)) out["ended"][word] = count;
  out["keys"] = keys_json(outcomes.front());
  out["variance_shares"] = variance_json(outcomes.front());
  for (std::size_t i = 1; i < outcomes.size(); ++i)
    out["outcomes"][outcomes[i].name] = outcome_json(outcomes[i]);
  out["table_hash"] = fmt::format("{:016x}", hash_bytes(csv_of(table)));
  out["origin"] = table.head.origin;
  return out.dump(2) + "\n";
}

std::string rollouts_screen(const Table& table) {
  std::vector<std::string> parts;
  for (const auto& [word, count] : endings(table)) parts.push_back(fmt::format("{} {}", count, word));
  std::string out =
      fmt::format("{}\n  {} rollouts: {}\n", table.head.title, table.head.size, fmt::join(parts, ", "));
  const std::vector<OutcomeEffects> outcomes = outcome_effects(table);
  std::size_t width = 34;
  for (const OutcomeEffects& of : outcomes) width = std::max(width, of.name.size());
  for (const OutcomeEffects& of : outcomes) {
    if (outcomes.size() > kTold || outcomes.size() * of.keys.size() > kMostLines) {
      if (&of == &outcomes.front())
        out += (of.all ? "  " + held_text(table) + "\n" : "") + fmt::format("\n  {:<{}} {:>11}  {:<25} {}\n",
                                                                            "figure", width, "mean",
                                                                            "nine in ten", "variance of");
      out += line_of(of, width);
      continue;
    }
    if (of.verdict) {
      out += fmt::format("  {}: {} of {} judged, share {} with its 95 % interval\n", of.name,
                         std::ranges::count(of.values, 1.0), of.values.size(), estimate_text(of.all));
    } else {
      out += fmt::format("\n  {}: mean {} with its 95 % interval, of {} rollouts", of.name,
                         estimate_text(of.all), of.values.size());
      if (!of.values.empty()) {
        const auto [low, high] = middle_90(of.values);
        out += fmt::format("; nine in ten from {:.4g} to {:.4g}", low, high);
      }
      out += "\n";
    }
    out += keys_text(of) + variance_text(of);
  }
  return out;
}

bool write_rollouts(const Table& table, const std::filesystem::path& out) {
  write_hdf5(table, out / "rollouts.h5");
  std::vector<OutcomeEffects> outcomes = outcome_effects(table);
  if (std::ranges::any_of(outcomes, &OutcomeEffects::varies))
    std::erase_if(outcomes, [](const OutcomeEffects& of) { return !of.varies(); });
  outcomes.resize(std::min(outcomes.size(), kTold));
  Report report;
  report.csv = csv_of(table);
  report.data = plot_data(outcomes);
  report.plots = plots_of(table, outcomes);
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

StudyCommands uncertain_commands(const std::filesystem::path& scene,
                                 const std::vector<std::string>& overrides, int count) {
  const std::string command =
      command_text({"run", scene.string()}, overrides) + fmt::format(" --uncertain {}", count);
  return {command, {}, {{"rollouts.csv", command + " --rollout {rollout}"}}};
}

StudyCommands rollouts_commands(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                                std::optional<int> seed) {
  const std::string seeded = seed ? fmt::format(" --seed {}", *seed) : "";
  return {
      command_text({"rollouts", file.string()}, overrides) + seeded,
      {},
      {{"rollouts.csv", command_text({"run", file.string()}, overrides) + " --rollout {rollout}" + seeded}}};
}

}  // namespace handsim::study
