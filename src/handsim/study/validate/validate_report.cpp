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

template <std::size_t N, class Enum>
const char* word_of(const std::array<const char*, N>& words, Enum value) {
  return words[static_cast<std::size_t>(value)];
}

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
           "  set title '{0}: {1:.0f} % of values within one spread'\n"
           "set xlabel '(ours - measured) / spread; of moment arms the root mean square over the angles'\n"
           "set xrange [-{2}:{2}]\nset yrange [{3}:0]\nset y2range [{3}:0]\nset grid xtics\n"
           "set ytics scale 0 ({4})\nset y2tics scale 0 ({5})\nset lmargin at screen 0.14\n"
           "set rmargin at screen 0.62\nset key horizontal samplen 1 at screen 0.98, screen 0.995 right top\n"
           "set object 1 rectangle from -1, graph 0 to 1, graph 1 fillcolor rgb '#dcebd5' fillstyle solid "
           "noborder behind\n"
           "{6}plot {7}, {8}, {9}\n",
           output::plot_text(spec.title),
           100 * result.within([](const Measurement&) { return true; }).share(), kMostSpreads + 0.2,
           layout.height, fmt::join(layout.kinds, ", "), fmt::join(layout.short_rows, ", "), lines,
           points(1, "pointtype 7 pointsize 0.6 linecolor rgb '#2e7d32'", "within"),
           points(2, "pointtype 7 pointsize 0.8 linecolor rgb '#c8553d'", "short"),
           points(3, "pointtype 13 pointsize 1.2 linecolor rgb '#c8553d'", "beyond"))});
}

/// Groups of rows by what they are, each row in one.
struct RowsThatAre {
  const char* name;
  RowFilter has;
};
std::array<RowsThatAre, 4> groups_of_rows() {
  return {{
      {"people, spread and conditions of the source",
       [](const Measurement& of) { return of.is_of_people(); }},
      {"people, some of these chosen",
       [](const Measurement& of) { return of.on == MeasuredOn::people && !of.is_of_people(); }},
      {"cadavers", [](const Measurement& of) { return of.on == MeasuredOn::cadavers; }},
      {"other models", [](const Measurement& of) { return of.on == MeasuredOn::model; }},
  }};
}

RowFilter both(const RowFilter& first, const RowFilter& second) {
  return [first, second](const Measurement& of) { return first(of) && second(of); };
}

RowFilter related(ValueIs how) {
  return [how](const Measurement& of) { return of.value_is == how; };
}

Json tally_json(const Tally& of) { return {{"within", of.within}, {"values", of.values}}; }

std::string tally_text(const Tally& of) {
  return of.values > 0 ? fmt::format("{:.4g} of {:.4g}", of.within, of.values) : "";
}

/// Values within one spread by what they are (lines) and by how ours relate to them (columns).
std::string groups_table(const ValidateResult& result) {
  std::string out = fmt::format("\n{:<45}", "values within one spread, of");
  for (const char* word : kValueIs) out += fmt::format("{:>15}", word);
  const auto line = [&](const char* name, const RowFilter& has) {
    std::string cells;
    for (std::size_t i = 0; i < kValueIs.size(); ++i)
      cells += fmt::format("{:>15}", tally_text(result.within(both(has, related(static_cast<ValueIs>(i))))));
    if (result.within(has).values > 0)
      out += fmt::format("\n{:<45}{}{:>17}", name, cells, tally_text(result.within(has)));
  };
  out += fmt::format("{:>17}", "all");
  for (const RowsThatAre& group : groups_of_rows()) line(group.name, group.has);
  line("all", [](const Measurement&) { return true; });
  return out + "\n";
}

/// Measured values within the middle 90 % of drawn hands, by kind.
std::string coverage_text(const ValidateResult& result) {
  std::string out;
  for (const RowsOfKind& group : groups_of(result))
    if (const Tally of = result.covered([&](const Measurement& row) { return row.kind == group.kind; });
        of.values > 0)
      out += fmt::format("{}{} {:.0f} % of {:.0f}", out.empty() ? "" : ", ", kind_name(group.kind),
                         100 * of.share(), of.values);
  const Tally all = result.covered([](const Measurement&) { return true; }),
              predicted = result.covered(&Measurement::is_predicted);
  if (all.values == 0) return "";
  return fmt::format(
      "{:.0f} % of {:.0f} measured values are within the middle 90 % of drawn hands, their spread added "
      "({:.0f} % of {:.0f} predictions): {}\n",
      100 * all.share(), all.values, 100 * predicted.share(), predicted.values, out);
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
  const auto add = [&](const ValidateRow& row) {
    const Measurement& of = *row.of;
    left_out += row.measured ? 0 : 1;
    if (!row.measured) return;
    const double scale = 1 / of.scale;
    std::string verdict = row.within() ? "within" : fmt::format("{:.1f} x", row.deviation);
    if (!row.within() && of.required) verdict += " short";
    out += fmt::format("{:<{}}  {:>9.3g}  {:>9.3g} +- {:>5.2g}  {:<6} {:<12} {}, {}: {}\n", of.name, width,
                       scale * row.ours, scale * of.value, scale * of.spread, of.unit, verdict,
                       word_of(kMeasuredOn, of.on), word_of(kValueIs, of.value_is), of.source);
    if (row.uncertainty)
      out += fmt::format(
          "{:>{}}  nine in ten hands {:.3g} to {:.3g}{}{}; {}\n", "", width, scale * row.uncertainty->low,
          scale * row.uncertainty->high, row.inside ? "" : ", OUTSIDE with the spread",
          row.uncertainty->missing > 0 ? fmt::format(", {} have none", row.uncertainty->missing) : "",
          owners_text(row.uncertainty->variance));
    if (!of.chosen.empty()) out += fmt::format("{:>{}}  chosen: {}\n", "", width, of.chosen);
    if (!row.within() && !of.reason.empty()) out += fmt::format("{:>{}}  {}\n", "", width, of.reason);
    required += of.required ? 1 : 0;
  };
  const auto rows = [&](bool predicted) {
    for (const ValidateRow& row : result.rows)
      if (row.of->is_predicted() == predicted) add(row);
  };
  rows(false);
  const Tally predicted = result.within(&Measurement::is_predicted),
              people = result.within(&Measurement::is_of_people),
              all = result.within([](const Measurement&) { return true; });
  if (predicted.values > 0)
    out += "\npredictions, to which neither a number of the hand nor a norm is fitted\n";
  rows(true);
  out += groups_table(result);
  if (people.values > 0)
    out += fmt::format("\n{} values of people with spread and conditions of their source are within it\n",
                       tally_text(people));
  if (predicted.values > 0)
    out += fmt::format("{} predictions are within one spread\n", tally_text(predicted));
  out += fmt::format(
      "{:.0f} % of {:.4g} values are within one spread (goal {:.0f} %); {} rows are required, {}\n",
      100 * all.share(), all.values, 100 * spec.goal, required,
      result.passed() ? "all within" : "not all within");
  out += coverage_text(result);
  if (left_out > 0) out += fmt::format("{} rows are simulations, which --runs runs\n", left_out);
  return out;
}

std::string validate_csv(const ValidateResult& result) {
  std::string out =
      "quantity,ours,measured,spread,unit,deviation_over_spread,verdict,required,of,spread_is,value_is,"
      "chosen,"
      "weight,source,reason,"
      "percentile_5,percentile_95,inside\n";
  for (const ValidateRow& row : result.rows) {
    if (!row.measured) continue;
    const Measurement& of = *row.of;
    out += fmt::format(
        "{},{:.6g},{:.6g},{:.6g},{},{:.4g},{},{},{},{},{},{},{:.4g},{},{},{}\n", quoted(of.name),
        row.ours / of.scale, of.value / of.scale, of.spread / of.scale, of.unit, row.deviation,
        row.within() ? "within" : "short", of.required ? "yes" : "no", word_of(kMeasuredOn, of.on),
        word_of(kSpreadIs, of.spread_is), word_of(kValueIs, of.value_is), quoted(of.chosen), row.weight,
        quoted(of.source), quoted(of.reason),
        row.uncertainty ? fmt::format("{:.6g},{:.6g},{}", row.uncertainty->low / of.scale,
                                      row.uncertainty->high / of.scale, row.inside ? "yes" : "no")
                        : ",,");
  }
  return out;
}

bool write_validate(const ValidateSpec& spec, const ValidateResult& result,
                    const std::filesystem::path& out) {
  const RowFilter all = [](const Measurement&) { return true; };
  Json json = {{"title", spec.title},
               {"values_within_spread", tally_json(result.within(all))},
               {"people_within_spread", tally_json(result.within(&Measurement::is_of_people))},
               {"predictions_within_spread", tally_json(result.within(&Measurement::is_predicted))},
               {"goal", spec.goal},
               {"required_rows_within", result.passed()}};
  for (const RowsThatAre& group : groups_of_rows())
    for (std::size_t i = 0; i < kValueIs.size(); ++i)
      if (const Tally of = result.within(both(group.has, related(static_cast<ValueIs>(i)))); of.values > 0)
        json["groups"][group.name][kValueIs[i]] = tally_json(of);
  if (const Tally covered = result.covered(all); covered.values > 0) json["inside_90"] = covered.share();
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
