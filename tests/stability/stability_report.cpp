#include "stability/stability.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/output/atomic_file.h"
#include "handsim/output/child.h"
#include "handsim/output/output_folder.h"
#include "handsim/output/render/contact_sheet.h"
#include "handsim/output/table/gnuplot.h"
#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/run/run.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {

/// In the order of StabilityVerdict.
constexpr std::array kVerdicts = {"held", "FELL SHORT", "short (known)", "held (known short)"};

const char* name(StabilityVerdict verdict) { return kVerdicts[static_cast<std::size_t>(verdict)]; }

/// `1.2e-05 m`.
std::string figure(std::optional<double> value, const std::string& unit) {
  if (!value) return "-";
  return fmt::format("{:.3g}{}{}", *value, unit.empty() ? "" : " ", unit);
}

std::string limit(const StabilityRow& row) {
  return fmt::format("{} {:.3g}", row.at_least ? ">=" : "<=", row.limit);
}

std::string milliseconds(double step) { return fmt::format("{:g}", 1e3 * step); }

/// Variant, place and time of the figure, or the fault, on one line.
std::string place(const StabilityRow& row) {
  std::vector<std::string> parts;
  if (!row.variant.empty()) parts.push_back(row.variant);
  if (!row.fault.empty())
    parts.push_back(row.fault);
  else if (!row.where.empty())
    parts.push_back(row.where);
  if (row.time) parts.push_back(fmt::format("at {:.4g} s", *row.time));
  std::string out = fmt::format("{}", fmt::join(parts, "; "));
  std::ranges::replace(out, '\n', ' ');
  return out;
}

std::string shortened(std::string text, std::size_t width) {
  if (text.size() <= width) return text;
  text.resize(width - 3);
  return text + "...";
}

std::string rows_table(const CaseResult& result) {
  std::string out =
      fmt::format("\n{}: {}\n  oracle: {}\n", result.of->name, result.of->title, result.of->oracle);
  const std::vector<StabilityRow> worst = worst_rows(result);
  std::set<std::string> short_of;
  for (const StabilityRow& row : worst) {
    out += fmt::format("  {:<16} {:<44} {:>6} {:>16} {:>12}  {:<18} {}\n", row.measure, row.way,
                       row.measure == "refused" ? "" : milliseconds(row.step), figure(row.value, row.unit),
                       limit(row), name(row.verdict), shortened(place(row), 100));
    if (row.verdict == StabilityVerdict::known_short) short_of.insert(row.measure);
  }
  for (const std::string& known : result.known) out += "  known: " + known + "\n";
  for (const std::string& measure : short_of) {
    std::vector<std::string> holders;
    for (const StabilityRow& row : worst)
      if (row.measure == measure && row.within())
        holders.push_back(fmt::format("{} {} ms", row.way, milliseconds(row.step)));
    out += fmt::format("  {} holds with {}\n", measure, fmt::join(holders, ", "));
  }
  return out;
}

std::string csv(const StabilityResult& result) {
  std::string out =
      "case,measure,unit,way,step[s],variant,measured,limit,limit_is,verdict,time[s],cpu[s],where,fault\n";
  for (const CaseResult& of : result.cases)
    for (const StabilityRow& row : of.rows)
      out += fmt::format(
          "{},{},{},{},{},{},{},{},{},{},{},{:.3g},{},{}\n", row.of_case, quoted(row.measure), row.unit,
          quoted(row.way), row.step, quoted(row.variant), row.value ? fmt::format("{}", *row.value) : "",
          row.limit, row.at_least ? "least" : "most", name(row.verdict),
          row.time ? fmt::format("{}", *row.time) : "", row.cpu, quoted(row.where), quoted(row.fault));
  return out;
}

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(fmt::format("{}", value)); }

Json row_json(const StabilityRow& row) {
  Json out = {{"measure", row.measure}, {"way", row.way}, {"step_s", row.step}};
  if (!row.variant.empty()) out["variant"] = row.variant;
  out["measured"] = row.value ? number(*row.value) : Json();
  out["unit"] = row.unit;
  out[row.at_least ? "least" : "most"] = row.limit;
  out["verdict"] = name(row.verdict);
  if (row.time) out["time_s"] = *row.time;
  out["cpu_s"] = row.cpu;
  if (!row.where.empty()) out["where"] = row.where;
  if (!row.fault.empty()) out["fault"] = row.fault;
  return out;
}

std::string json(const StabilitySpec& spec, const StabilityResult& result) {
  Json cases = Json::array();
  for (const CaseResult& of : result.cases) {
    Json entry = {{"name", of.of->name}, {"title", of.of->title}, {"oracle", of.of->oracle}};
    entry["known_shortfalls"] = of.known;
    entry["rows"] = Json::array();
    for (const StabilityRow& row : of.rows) entry["rows"].push_back(row_json(row));
    cases.push_back(std::move(entry));
  }
  Json out = {
      {"title", spec.title}, {"passed", result.passed()}, {"quick", result.quick}, {"wall_s", result.wall}};
  add_origin(out);
  out["versions"]["engines"] = result.engines;
  out["cases"] = std::move(cases);
  return out.dump(2) + "\n";
}

/// Range of figure over limit in the plot.
constexpr double kLeastSeverity = 1e-6, kMostSeverity = 1e4;

/// One mark for each row of the table, cases from top to bottom.
void add_overview(const StabilityResult& result, Report& report) {
  struct Marks {
    const char* block;
    const char* style;
    const char* title;
    std::string data = {};
  };
  Marks held{"$held", "pt 7 ps 0.9 lc rgb '#3a7d44'", "holds"},
      known{"$known", "pt 9 ps 1.3 lc rgb '#e08e1b'", "falls short (known of this engine or setting)"},
      failed{"$failed", "pt 5 ps 1.3 lc rgb '#c1121f'", "falls short"};
  std::string ticks;
  const auto count = static_cast<int>(result.cases.size());
  for (int i = 0; i < count; ++i) {
    const CaseResult& of = result.cases[static_cast<std::size_t>(i)];
    std::string name = of.of->name;
    std::ranges::replace(name, '_', ' ');
    ticks += fmt::format("{}'{}' {}", i > 0 ? ", " : "", output::plot_text(name), count - i);
    for (const StabilityRow& row : worst_rows(of)) {
      const double x = std::clamp(row.severity(), kLeastSeverity, kMostSeverity);
      Marks& marks = row.verdict == StabilityVerdict::fell_short    ? failed
                     : row.verdict == StabilityVerdict::known_short ? known
                                                                    : held;
      marks.data += fmt::format("{} {}\n", x, count - i);
    }
  }
  std::vector<std::string> curves;
  for (const Marks& marks : {held, known, failed}) {
    report.data += fmt::format("{} << EOD\n{}EOD\n", marks.block, marks.data);
    if (!marks.data.empty())
      curves.push_back(
          fmt::format("{} using 1:2 with points {} title '{}'", marks.block, marks.style, marks.title));
  }
  report.plots.push_back(
      {"stability", fmt::format("noenhanced size 1200,{} font 'DejaVu Sans,11'", 140 + 24 * count),
       fmt::format(
           "  set title 'Hard cases: figure over limit, one mark for each engine, method and step'\n"
           "  set logscale x\n  set xrange [{0}:{1}]\n  set yrange [0.3:{2}]\n  set ytics ({3})\n"
           "  set format x '10^{{%L}}'\n  set termoption enhanced\n  unset ylabel\n"
           "  set xlabel 'figure / limit (left of 1: holds; values beyond the range are on its edge)'\n"
           "  set grid x y\n  set key top right outside horizontal\n"
           "  set arrow 1 from 1,0.3 to 1,{2} nohead lw 2 lc rgb '#404040' front\n"
           "  plot {4}\n  unset arrow 1\n",
           kLeastSeverity * 0.5, kMostSeverity * 2, count + 0.7, ticks, fmt::join(curves, ", "))});
}

/// Names of all files of a study.
std::vector<std::string> stability_files(const StabilitySpec& spec) {
  std::vector<std::string> out = {"scenes.png"};
  for (const StabilityCase& of : spec.cases)
    if (of.picture) out.push_back("scene_" + of.name + ".png");
  const std::vector<std::string> files = report_files("stability", {"stability"});
  out.insert(out.end(), files.begin(), files.end());
  return out;
}

}  // namespace

std::vector<StabilityRow> worst_rows(const CaseResult& result) {
  std::vector<StabilityRow> out;
  for (const MeasureSpec& measure : result.of->measures)
    for (const StabilityRow& row : result.rows) {
      if (row.measure != measure.name) continue;
      const auto same = std::ranges::find_if(out, [&](const StabilityRow& other) {
        return other.measure == row.measure && other.way == row.way && other.step == row.step;
      });
      if (same == out.end())
        out.push_back(row);
      else if (row.severity() > same->severity())
        *same = row;
    }
  for (const StabilityRow& row : result.rows)
    if (row.measure == "refused") out.push_back(row);
  return out;
}

std::string stability_table(const StabilityResult& result) {
  std::string out = fmt::format("  {:<16} {:<44} {:>6} {:>16} {:>12}  {:<18} {}\n", "measure", "way", "ms",
                                "measured", "limit", "verdict", "worst variant, place, time");
  std::size_t rows = 0, counts[4] = {};
  for (const CaseResult& of : result.cases) {
    out += rows_table(of);
    rows += of.rows.size();
    for (const StabilityRow& row : of.rows) ++counts[static_cast<std::size_t>(row.verdict)];
  }
  out += fmt::format(
      "\n{} cases, {} figures in {:.0f} s: {} held, {} fell short, {} fell short (known), {} held (known "
      "short)\n",
      result.cases.size(), rows, result.wall, counts[0], counts[1], counts[2], counts[3]);
  return out;
}

bool write_stability(const StabilitySpec& spec, const StabilityResult& result,
                     const std::filesystem::path& out) {
  output::make_folder(out);
  Report report{csv(result), json(spec, result), {}, {}};
  add_overview(result, report);
  return write_report(out, "stability", report);
}

std::optional<std::string> draw_stability(const StabilityResult& result, const std::filesystem::path& out) {
  constexpr int kWidth = 320, kHeight = 240;
  struct Picture {
    const StabilityCase* of;
    scene::Scene scene;
    simulation::PictureState moment;
  };
  std::vector<Picture> pictures;
  for (const CaseResult& of : result.cases) {
    if (!of.of->picture) continue;
    std::vector<std::string> set = of.of->set;
    const Way& way = of.of->ways.front();
    set.insert(set.end(), way.set.begin(), way.set.end());
    set.push_back("solver.step=" + number_text(way.steps.front()));
    for (const std::vector<Alternative>& dimension : of.of->varied)
      set.insert(set.end(), dimension.front().set.begin(), dimension.front().set.end());
    set.push_back(fmt::format("pictures.size=[{}, {}]", kWidth, kHeight));
    scene::Scene scene = scene::load_scene(of.of->scenes.front(), set);
    simulation::PictureState moment = simulation::picture_state_at(scene, *of.of->picture);
    pictures.push_back({of.of, std::move(scene), std::move(moment)});
  }
  if (pictures.empty()) return std::nullopt;
  const auto draw_all = [&](const output::Progress&) {
    output::ContactSheet sheet({static_cast<int>(pictures.size()), kWidth, kHeight, "hard cases"});
    for (const Picture& picture : pictures) {
      const output::Image image =
          simulation::draw({picture.scene.model, picture.scene.spec.pictures}, picture.moment);
      output::write_png(image, out / ("scene_" + picture.of->name + ".png"));
      sheet.add(image, picture.of->name);
    }
    output::write_png(sheet.image(), out / "scenes.png");
  };
  return output::run_in_child(draw_all, {});
}

StudyEnd stability(StabilityOptions options, const StudyRun& run) {
  const StabilitySpec spec = load_stability(options.study);
  const output::OutputFolder folder(run.out, stability_files(spec), [&] {
    std::vector<std::filesystem::path> out = {options.study};
    for (const StabilityCase& of : spec.cases) out.insert(out.end(), of.scenes.begin(), of.scenes.end());
    return out;
  });
  options.progress = run.progress;
  const StabilityResult result = run_stability(spec, options);
  StudyEnd end{spec.title + "\n" + stability_table(result)};
  tell(run, end);
  folder.clear();
  end.passed = result.passed();
  end.plotted = write_stability(spec, result, run.out);
  StudyCommands commands{command_text({"stability", options.study.string()})};
  for (const CaseResult& of : result.cases)
    for (const StabilityRow& row : of.rows) commands.rows["stability.csv"].push_back(row.command);
  finish_study(run.out, commands, run.report);
  if (options.pictures)
    if (const std::optional<std::string> failure = draw_stability(result, run.out))
      end.missing.push_back("pictures: " + *failure);
  return end;
}

}  // namespace handsim::study
