#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/data_folder.h"
#include "handsim/output/output_folder.h"
#include "handsim/output/table/gnuplot.h"
#include "handsim/study/report.h"
#include "handsim/study/validate/validate.h"

namespace handsim::study {

namespace {

constexpr double kMostSpreads = 4;                    ///< of the plot; rows beyond are at its edge
constexpr double kPointHeight = 0.3, kTicHeight = 1;  ///< of a row without and with its name, in lines
constexpr double kGroupHeight = 2, kLinePixels = 16;  ///< two lines name a group
constexpr std::size_t kLongestName = 56;              ///< of a row, in characters

/// The measured rows of a kind.
struct RowsOfKind {
  Measured kind;
  std::vector<const ValidateRow*> rows;
  std::size_t within = 0;
};

std::vector<RowsOfKind> groups_of(const ValidateResult& result) {
  std::vector<RowsOfKind> out;
  for (const ValidateRow& row : result.rows) {
    if (!row.measured) continue;
    auto found =
        std::ranges::find_if(out, [&](const RowsOfKind& group) { return group.kind == row.of->kind; });
    if (found == out.end()) found = out.insert(out.end(), RowsOfKind{row.of->kind, {}, 0});
    found->rows.push_back(&row);
    found->within += row.within() ? 1 : 0;
  }
  return out;
}

/// The first characters of a text in UTF-8.
std::string shortened(const std::string& text) {
  std::size_t end = std::min(text.size(), kLongestName);
  while (end > 0 && end < text.size() && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80) --end;
  return end < text.size() ? text.substr(0, end) + "..." : text;
}

/// Rows from the top, the kinds' names on the left, names of rows that fall short on the right.
struct Layout {
  std::string points;                          ///< deviation, height, 1 for within, 2 for short, 3 for beyond
  std::vector<std::string> kinds, short_rows;  ///< tics
  std::vector<double> between;                 ///< heights of lines between kinds
  double height = 0;                           ///< [lines]
};

Layout layout_of(const std::vector<RowsOfKind>& groups) {
  Layout out;
  for (const RowsOfKind& group : groups) {
    double rows = 0;
    for (const ValidateRow* row : group.rows) rows += row->within() ? kPointHeight : kTicHeight;
    const double height = std::max(rows, kGroupHeight) + 2 * kPointHeight;
    std::string name(kind_name(group.kind));
    std::ranges::replace(name, '_', ' ');
    out.kinds.push_back(
        fmt::format("\"{}\\n{} of {}\" {}", name, group.within, group.rows.size(), out.height + height / 2));
    double at = out.height + (height - rows) / 2;
    for (const ValidateRow* row : group.rows) {
      const double deviation = std::copysign(row->deviation, row->ours - row->of->value);  // arms: of means
      const double own = row->within() ? kPointHeight : kTicHeight;
      const bool beyond = row->deviation > kMostSpreads;
      out.points += fmt::format("{} {} {}\n", std::clamp(deviation, -kMostSpreads, kMostSpreads),
                                at + own / 2, row->within() ? 1 : 2 + static_cast<int>(beyond));
      if (!row->within())
        out.short_rows.push_back(fmt::format("'{}: {:+.1f}' {}", shortened(output::plot_text(row->of->name)),
                                             deviation, at + own / 2));
      at += own;
    }
    out.height += height;
    out.between.push_back(out.height);
  }
  return out;
}

/// Differences over spreads, one point for each row, and a band of one spread.
void add_plot(const ValidateSpec& spec, const ValidateResult& result, Report& report) {
  const Layout layout = layout_of(groups_of(result));
  if (layout.points.empty()) return;
  report.data = "$rows << EOD\n" + layout.points + "EOD\n";
  std::string lines;
  for (const double height : layout.between)
    lines += fmt::format(
        "set arrow from graph 0, first {0} to graph 1, first {0} nohead linecolor rgb '#bbbbbb'\n", height);
  const auto points = [](int which, const char* style, const char* title) {
    return fmt::format("$rows using ($3 == {} ? $1 : NaN):2 with points {} title '{}'", which, style, title);
  };
  report.plots.push_back(
      {"validate",
       fmt::format("noenhanced size 1100,{:.0f} font 'DejaVu Sans,9'", 110 + kLinePixels * layout.height),
       fmt::format(
           "  set title '{0}: {1:.0f} % of rows within one spread'\n"
           "set xlabel '(ours - measured) / spread; of moment arms the root mean square over the angles'\n"
           "set xrange [-{2}:{2}]\nset yrange [{3}:0]\nset y2range [{3}:0]\nset grid xtics\n"
           "set ytics scale 0 ({4})\nset y2tics scale 0 ({5})\nset lmargin at screen 0.14\n"
           "set rmargin at screen 0.62\nset key horizontal samplen 1 at screen 0.98, screen 0.995 right top\n"
           "set object 1 rectangle from -1, graph 0 to 1, graph 1 fillcolor rgb '#dcebd5' fillstyle solid "
           "noborder behind\n"
           "{6}plot {7}, {8}, {9}\n",
           output::plot_text(spec.title), 100 * result.share, kMostSpreads + 0.2, layout.height,
           fmt::join(layout.kinds, ", "), fmt::join(layout.short_rows, ", "), lines,
           points(1, "pointtype 7 pointsize 0.6 linecolor rgb '#2e7d32'", "within"),
           points(2, "pointtype 7 pointsize 0.8 linecolor rgb '#c8553d'", "short"),
           points(3, "pointtype 13 pointsize 1.2 linecolor rgb '#c8553d'", "beyond"))});
}

StudyCommands validate_commands(const std::filesystem::path& file, bool runs, const ValidateResult& result) {
  std::vector<std::string> words = {"validate", file.string()};
  if (runs) words.emplace_back("--runs");
  StudyCommands out{command_text(words)};
  for (const ValidateRow& row : result.rows)
    if (row.measured)
      out.rows["validate.csv"].push_back(row.of->kind == Measured::simulation
                                             ? command_text({"run", row.of->scene.string()}, row.of->changes)
                                             : "");
  return out;
}

}  // namespace

std::string validate_table(const ValidateSpec& spec, const ValidateResult& result) {
  std::size_t width = 8;
  for (const ValidateRow& row : result.rows) width = std::max(width, row.of->name.size());
  std::string out = fmt::format("{:<{}}  {:>9}  {:>18}  {:<6} {:<12} {}\n", "quantity", width, "ours",
                                "measured +- spread", "unit", "verdict", "source");
  int required = 0;
  std::size_t left_out = 0;
  std::array<std::size_t, 2> rows{};  // fitted, predicted
  const auto add = [&](const ValidateRow& row) {
    const Measurement& of = *row.of;
    left_out += row.measured ? 0 : 1;
    if (!row.measured) return;
    ++rows[of.predicted];
    const double scale = 1 / of.scale;
    std::string verdict = row.within() ? "within" : fmt::format("{:.1f} x", row.deviation);
    if (!row.within() && of.required) verdict += " short";
    out += fmt::format("{:<{}}  {:>9.3g}  {:>9.3g} +- {:>5.2g}  {:<6} {:<12} {}\n", of.name, width,
                       scale * row.ours, scale * of.value, scale * of.spread, of.unit, verdict, of.source);
    if (row.uncertainty)
      out += fmt::format(
          "{:>{}}  nine in ten hands {:.3g} to {:.3g}{}{}; {}\n", "", width, scale * row.uncertainty->low,
          scale * row.uncertainty->high, row.inside ? "" : ", OUTSIDE with the spread",
          row.uncertainty->missing > 0 ? fmt::format(", {} have none", row.uncertainty->missing) : "",
          owners_text(row.uncertainty->variance));
    if (!row.within() && !of.reason.empty()) out += fmt::format("{:>{}}  {}\n", "", width, of.reason);
    required += of.required ? 1 : 0;
  };
  for (const bool predicted : {false, true}) {
    if (predicted && result.predicted) out += "\npredictions, to which nothing of the hand is fitted\n";
    for (const ValidateRow& row : result.rows)
      if (row.of->predicted == predicted) add(row);
  }
  out += fmt::format("\n{:.0f} % of {} rows are within one spread (goal {:.0f} %); {} are required, {}\n",
                     100 * result.share, rows[0], 100 * spec.goal, required,
                     result.passed() ? "all within" : "not all within");
  if (result.predicted)
    out +=
        fmt::format("{:.0f} % of {} predictions are within one spread\n", 100 * *result.predicted, rows[1]);
  if (result.coverage)
    out += fmt::format(
        "{:.0f} % of the measured values are within the middle 90 % of drawn hands, their spread added\n",
        100 * *result.coverage);
  if (left_out > 0) out += fmt::format("{} rows are simulations, which --runs runs\n", left_out);
  return out;
}

std::string validate_csv(const ValidateResult& result) {
  std::string out =
      "quantity,ours,measured,spread,unit,deviation_over_spread,verdict,required,predicted,source,reason,"
      "percentile_5,percentile_95,inside\n";
  for (const ValidateRow& row : result.rows) {
    if (!row.measured) continue;
    const Measurement& of = *row.of;
    out += fmt::format(
        "{},{:.6g},{:.6g},{:.6g},{},{:.4g},{},{},{},{},{},{}\n", quoted(of.name), row.ours / of.scale,
        of.value / of.scale, of.spread / of.scale, of.unit, row.deviation, row.within() ? "within" : "short",
        of.required ? "yes" : "no", of.predicted ? "yes" : "no", quoted(of.source), quoted(of.reason),
        row.uncertainty ? fmt::format("{:.6g},{:.6g},{}", row.uncertainty->low / of.scale,
                                      row.uncertainty->high / of.scale, row.inside ? "yes" : "no")
                        : ",,");
  }
  return out;
}

bool write_validate(const ValidateSpec& spec, const ValidateResult& result,
                    const std::filesystem::path& out) {
  Json json = {{"title", spec.title},
               {"rows_within_spread", result.share},
               {"goal", spec.goal},
               {"required_rows_within", result.passed()}};
  if (result.predicted) json["predictions_within_spread"] = *result.predicted;
  if (result.coverage) json["inside_90"] = *result.coverage;
  add_origin(json);
  Report report{validate_csv(result), json.dump(2) + "\n", {}, {}};
  add_plot(spec, result, report);
  return write_report(out, "validate", report);
}

StudyEnd validate(const ValidateOptions& options, const StudyRun& run) {
  const std::filesystem::path file = options.file.value_or(data_folder() / "config/validate.yaml");
  const ValidateSpec spec = load_validate(file);
  std::optional<output::OutputFolder> folder;
  if (!run.out.empty())
    folder.emplace(run.out, report_files("validate", {"validate"}),
                   [&] { return std::vector<std::filesystem::path>{file}; });
  const ValidateResult result = run_validate(
      spec, options.runs ? std::optional(run.out / "runs") : std::nullopt, options.uncertain, run.progress);
  StudyEnd end{spec.title + "\n\n" + validate_table(spec, result)};
  end.passed = result.passed();
  tell(run, end);
  if (!folder) return end;
  folder->clear();
  end.plotted = write_validate(spec, result, run.out);
  finish_study(run.out, validate_commands(file, options.runs, result), run.report);
  return end;
}

}  // namespace handsim::study
