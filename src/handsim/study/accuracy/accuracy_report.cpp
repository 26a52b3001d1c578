#include "handsim/study/accuracy/accuracy.h"

#include <cmath>

#include <fmt/format.h>

#include "handsim/output/output_folder.h"
#include "handsim/output/table/gnuplot.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {

Fields fields_of(const AccuracyRow& row) {
  if (row.fault)
    return {{"method", "method", row.method}, {"step", "step_s", row.step}, {"note", "fault", *row.fault}};
  return {{"method", "method", row.method},
          {"step", "step_s", row.step},
          {"rate_error_rms", "rate_error_rms", row.rate_error},
          {"early_rate_error_rms", "early_rate_error_rms", row.early_rate_error},
          {"position_error_rms", "position_error_rms", row.position_error},
          {"joint_gap", "joint_gap_m", row.gap},
          {"energy_error", "energy_error", row.energy_error ? Json(*row.energy_error) : Json()},
          {"cpu_seconds_per_second", "cpu_seconds_per_second", row.cpu_per_second},
          {"times_real_time", "times_real_time", row.times_real_time()},
          {"", "own_reference", row.own_reference},
          {"", "is_reference", row.is_reference},
          {"note", "",
           row.is_reference    ? "its own reference"
           : row.own_reference ? "compared with its smallest step"
                               : "",
           1, "{}"}};
}

/// A line of a plot: one method, or several with the same AccuracyMethod::line.
struct Line {
  std::string title;
  bool peer = false;
  bool has_steps = true;  ///< false if its methods differ in their tolerance instead of their step
  std::vector<const AccuracyRow*> rows;
};

/// The lines of plots of errors and costs, without methods whose own scene has another reference.
std::vector<Line> lines_of(const AccuracySpec& spec, const AccuracyResult& result) {
  std::vector<Line> lines;
  for (const AccuracyMethod& method : spec.methods) {
    if (method.scene) continue;
    const std::string title = method.line.value_or(method.name);
    if (lines.empty() || lines.back().title != title)
      lines.push_back({title, method.outside.has_value(), !method.line, {}});
    for (const AccuracyRow& row : result.rows)
      if (row.method == method.name && !row.fault && !row.is_reference) lines.back().rows.push_back(&row);
  }
  std::erase_if(lines, [](const Line& line) { return line.rows.empty(); });
  return lines;
}

/// Line colours that are distinguishable on white.
std::string style(std::size_t index, bool dashed) {
  static const char* const colours[] = {"#0060ad", "#d62728", "#2ca02c", "#ff7f0e", "#9467bd",
                                        "#8c564b", "#17becf", "#e377c2", "#7f7f7f", "#bcbd22"};
  return fmt::format("linecolor rgb '{}' dashtype {} linewidth {}", colours[index % std::size(colours)],
                     dashed ? 2 : 1, dashed ? 2 : 1.5);
}

/// One gnuplot data block for each line: step, error, early error, cost.
std::string blocks(const std::vector<Line>& lines) {
  std::string out;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    out += fmt::format("$m{} << EOD\n", i);
    for (const AccuracyRow* row : lines[i].rows)
      out += fmt::format("{} {} {} {}\n", row->step, row->rate_error, row->early_rate_error,
                         row->cpu_per_second);
    out += "EOD\n";
  }
  return out;
}

/// The plot command. Lines of handsim are solid, those of other engines dashed.
std::string plot_of(const std::vector<Line>& lines, const char* columns, bool against_step) {
  std::string out;
  std::size_t own = 0, peers = 0;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const Line& line = lines[i];
    const std::size_t colour = line.peer ? peers++ : own++;
    if (against_step && !line.has_steps) continue;
    out += fmt::format("{} $m{} using {} with linespoints {} pointtype {} title '{}' noenhanced",
                       out.empty() ? "plot" : ", \\\n    ", i, columns, style(colour, line.peer), i % 15 + 1,
                       output::plot_text(line.title));
  }
  return out + "\n";
}

/// The rate of the first observed coordinate and the reference: by step, handsim's and others' panels.
void add_velocity_plot(const AccuracySpec& spec, const AccuracyResult& result, Report& report) {
  std::string panels;
  int block = 0, count = 0;
  const auto add = [&](const Series& series, const std::string& title, const std::string& style) {
    report.data += fmt::format("$v{} << EOD\n", block);
    for (std::size_t i = 0; i < series.time.size(); ++i)
      report.data += fmt::format("{:.6g} {:.9g}\n", series.time[i], series.rate[i][0]);
    report.data += "EOD\n";
    return fmt::format("$v{} using 1:2 with lines {} title '{}' noenhanced", block++, style,
                       output::plot_text(title));
  };
  const auto panel = [&](double step, bool peer) {
    std::string lines;
    std::size_t colour = 0;
    for (const AccuracyMethod& method : spec.methods)
      for (const AccuracyRow& row : result.rows)
        if (method.outside.has_value() == peer && row.method == method.name && !row.series.time.empty() &&
            std::abs(row.step - step) < 1e-12)
          lines += (lines.empty() ? "plot " : ", ") + add(row.series, row.method, style(colour++, false));
    if (lines.empty()) return;
    if (result.reference)
      lines += ", " + add(*result.reference, "reference", "linecolor 'black' dashtype 3 linewidth 2.5");
    panels +=
        fmt::format("set title 'step {:g} ms{}'\n{}\n", 1e3 * step, peer ? ", other engines" : "", lines);
    ++count;
  };
  for (const double step : spec.plot_steps)
    for (const bool peer : {false, true}) panel(step, peer);
  if (panels.empty()) return;
  report.plots.push_back(
      {"velocity", fmt::format("size 1400,{}", 380 * count),
       fmt::format(
           "  unset logscale\n  set format '%g'\n  set xlabel 'time [s]'\n  set ylabel 'rate [{}/s]'\n"
           "  set key outside right font ',9'\n  set multiplot layout {},1\n{}  unset multiplot\n",
           result.unit, count, panels)});
}

Report report_of(const AccuracySpec& spec, const AccuracyResult& result) {
  const std::vector<Line> lines = lines_of(spec, result);
  std::vector<Fields> rows;
  for (const AccuracyRow& row : result.rows) rows.push_back(fields_of(row));
  Json json = {{"title", spec.title}, {"unit", result.unit}, {"early_window_s", spec.early}};
  add_origin(json);
  json["versions"]["engines"] = result.engines;
  json["rows"] = json_table(rows);
  const std::string head = fmt::format(
      "method,step[s],rate_error_rms[{0}/s],early_rate_error_rms[{0}/s],position_error_rms[{0}],"
      "joint_gap[m],energy_error,cpu_seconds_per_second,times_real_time,note",
      result.unit);
  Report out{csv_table(head, rows), json.dump(2) + "\n", blocks(lines), {}};
  out.data += "set logscale xy\nset format '10^{%L}'\nset grid\nset key outside right font ',11'\n";
  const auto add = [&](const char* name, const char* title, const std::string& x, const std::string& y,
                       const char* columns, bool against_step) {
    out.plots.push_back({name, "size 1400,800",
                         fmt::format("  {}set title '{}'\n  set xlabel '{}'\n  set ylabel '{}'\n  {}",
                                     against_step ? "set autoscale xfix\n  " : "", title, x, y,
                                     plot_of(lines, columns, against_step))});
  };
  const std::string cost = "CPU seconds per simulated second";
  const std::string error = fmt::format("[{}/s]", result.unit);
  add("error_cost", "error against cost", cost, "RMS rate error over the whole run " + error, "4:2", false);
  add("cost_step", "cost against step", "step [s]", cost, "1:4", true);
  add("error_step", "early error against step", "step [s]",
      fmt::format("RMS rate error up to {:g} s {}", spec.early, error), "1:3", true);
  add_velocity_plot(spec, result, out);
  return out;
}

}  // namespace

std::string accuracy_table(const AccuracyResult& result, double early) {
  std::string out = fmt::format("{:<34} {:>8} {:>12} {:>12} {:>12} {:>10} {:>10} {:>12} {:>10}\n", "method",
                                "step ms", "rate error", fmt::format("to {:g} s", early), "pos. error",
                                "gap m", "energy", "CPU s per s", "x real");
  for (const AccuracyRow& row : result.rows) {
    if (row.fault) {
      out += fmt::format("{:<34} {:>8g} {}\n", row.method, 1e3 * row.step, *row.fault);
      continue;
    }
    out += fmt::format(
        "{:<34} {:>8g} {:>12} {:>12} {:>12.3g} {:>10.2g} {:>10} {:>12.3g} {:>10.3g}\n", row.method,
        1e3 * row.step, row.is_reference ? "(reference)" : fmt::format("{:.3g}", row.rate_error),
        row.is_reference ? "" : fmt::format("{:.3g}", row.early_rate_error), row.position_error, row.gap,
        row.energy_error ? fmt::format("{:.2g}", *row.energy_error) : "-", row.cpu_per_second,
        row.times_real_time());
  }
  return out;
}

std::string cheapest_table(const AccuracyResult& result) {
  const AccuracyRow* last = nullptr;
  std::string out, line;
  for (const double error : {0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10}) {
    const AccuracyRow* row = cheapest(result, error);
    // A row that is the cheapest for several errors is shown at the smallest one.
    if (row != last) out += line;
    line.clear();
    last = row;
    if (!row) break;
    line = fmt::format("{:<16g} {:<34} {:>8g} {:>12.3g} {:>12.3g}\n", error, row->method, 1e3 * row->step,
                       row->rate_error, row->cpu_per_second);
  }
  out += line;
  if (out.empty()) return "";
  return fmt::format("{:<16} {:<34} {:>8} {:>12} {:>12}\n", "error at most", "cheapest", "step ms",
                     "rate error", "CPU s per s") +
         out;
}

bool write_accuracy(const AccuracySpec& spec, const AccuracyResult& result,
                    const std::filesystem::path& out) {
  return write_report(out, "accuracy", report_of(spec, result));
}

StudyEnd accuracy(const AccuracyOptions& options, const StudyRun& run) {
  AccuracySpec spec = load_accuracy(options.study);
  spec.methods.insert(spec.methods.end(), options.more.begin(), options.more.end());
  const std::vector<std::string> files =
      report_files("accuracy", {"error_cost", "cost_step", "error_step", "velocity"});
  const output::OutputFolder folder(run.out, files, [&] {
    std::vector<std::filesystem::path> out = {options.study, spec.scene};
    for (const AccuracyMethod& method : spec.methods)
      if (method.scene) out.push_back(*method.scene);
    return out;
  });
  const AccuracyResult result = run_accuracy(spec, run.progress);
  StudyEnd end{
      fmt::format("{}\nRMS rate error [{}/s] over the whole run and up to {:g} s; the error over the whole "
                  "run saturates once the motions are out of phase.\n\n{}",
                  spec.title, result.unit, spec.early, accuracy_table(result, spec.early))};
  if (result.reference) end.text += "\n" + cheapest_table(result);
  end.text += "\n";
  tell(run, end);
  folder.clear();
  end.plotted = write_accuracy(spec, result, run.out);
  StudyCommands commands{command_text({"accuracy", options.study.string()})};
  for (const AccuracyRow& row : result.rows) commands.rows["accuracy.csv"].push_back(row.command);
  finish_study(run.out, commands, run.report);
  if (!options.target) return end;
  const AccuracyRow* row = cheapest(result, *options.target);
  end.passed = row != nullptr;
  end.after = row ? fmt::format(
                        "cheapest at {:g} {}/s: {} at {:g} ms, error {:.3g}, {:.3g} CPU seconds per "
                        "simulated second\n",
                        *options.target, result.unit, row->method, 1e3 * row->step, row->rate_error,
                        row->cpu_per_second)
                  : fmt::format("no row reaches an error of {:g} {}/s\n", *options.target, result.unit);
  return end;
}

}  // namespace handsim::study
