#include "handsim/study/accuracy_report.h"

#include <cstdlib>

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "handsim/output/atomic_file.h"
#include "handsim/study/machine.h"

namespace handsim::study {

namespace {

using Json = nlohmann::ordered_json;

/// Without what could end a quoted text of gnuplot's or begin a command.
std::string plain(std::string text) {
  for (char& c : text)
    if (c == '\'' || c == '`' || static_cast<unsigned char>(c) < ' ') c = ' ';
  return text;
}

/// Quoted for CSV.
std::string quoted(std::string text) {
  for (std::size_t at = 0; (at = text.find('"', at)) != std::string::npos; at += 2) text.insert(at, 1, '"');
  return "\"" + text + "\"";
}

std::string csv(const AccuracyResult& result) {
  const std::string& unit = result.unit;
  std::string out = fmt::format(
      "method,step[s],rate_error_rms[{0}/s],early_rate_error_rms[{0}/"
      "s],position_error_rms[{0}],joint_gap[m],energy_error,"
      "cpu_seconds_per_second,times_real_time,note\n",
      unit);
  for (const AccuracyRow& row : result.rows) {
    if (row.fault) {
      out += fmt::format("{},{},,,,,,,,{}\n", quoted(row.method), row.step, quoted(*row.fault));
      continue;
    }
    out += fmt::format("{},{},{},{},{},{},{},{},{},{}\n", quoted(row.method), row.step, row.rate_error,
                       row.early_rate_error, row.position_error, row.gap,
                       row.energy_error ? fmt::format("{}", *row.energy_error) : "", row.cpu_per_second,
                       row.times_real_time(), row.is_reference ? "its own reference" : "");
  }
  return out;
}

std::string json(const AccuracySpec& spec, const AccuracyResult& result) {
  Json rows = Json::array();
  for (const AccuracyRow& row : result.rows) {
    Json entry = {{"method", row.method}, {"step_s", row.step}};
    if (row.fault) {
      entry["fault"] = *row.fault;
    } else {
      entry["rate_error_rms"] = row.rate_error;
      entry["early_rate_error_rms"] = row.early_rate_error;
      entry["position_error_rms"] = row.position_error;
      entry["joint_gap_m"] = row.gap;
      entry["energy_error"] = row.energy_error ? Json(*row.energy_error) : Json();
      entry["cpu_seconds_per_second"] = row.cpu_per_second;
      entry["times_real_time"] = row.times_real_time();
      entry["is_reference"] = row.is_reference;
    }
    rows.push_back(std::move(entry));
  }
  Json out = {{"title", spec.title}, {"unit", result.unit}, {"early_window_s", spec.early}};
  out["machine"] = {{"processor", processor()}, {"system", operating_system()}};
  out["versions"] = {{"handsim", HANDSIM_VERSION}, {"compiler", __VERSION__}};
  out["rows"] = std::move(rows);
  return out.dump(2) + "\n";
}

/// One data block a method, for gnuplot: step, error, early error, cost.
std::string blocks(const AccuracySpec& spec, const AccuracyResult& result) {
  std::string out;
  for (std::size_t m = 0; m < spec.methods.size(); ++m) {
    out += fmt::format("$m{} << EOD\n", m);
    for (const AccuracyRow& row : result.rows)
      if (row.method == spec.methods[m].name && !row.fault && !row.is_reference)
        out +=
            fmt::format("{} {} {} {}\n", row.step, row.rate_error, row.early_rate_error, row.cpu_per_second);
    out += "EOD\n";
  }
  return out;
}

std::string plot_of(const AccuracySpec& spec, const AccuracyResult& result, const char* columns) {
  std::string out;
  for (std::size_t m = 0; m < spec.methods.size(); ++m) {
    // Rows with a scene of their own have a reference of their own: their errors do not compare.
    if (spec.methods[m].scene) continue;
    bool any = false;
    for (const AccuracyRow& row : result.rows)
      any = any || (row.method == spec.methods[m].name && !row.fault && !row.is_reference);
    if (!any) continue;
    out +=
        fmt::format("{} $m{} using {} with linespoints pointtype {} linewidth 1.5 title '{}' noenhanced",
                    out.empty() ? "plot" : ", \\\n    ", m, columns, m % 14 + 1, plain(spec.methods[m].name));
  }
  return out + "\n";
}

/// Motion of the first observed coordinate at the plotted steps beside the reference.
std::string velocity_plots(const AccuracySpec& spec, const AccuracyResult& result) {
  std::string data, plots;
  int block = 0;
  const auto add = [&](const Series& series, const std::string& title, const char* style) {
    data += fmt::format("$v{} << EOD\n", block);
    for (std::size_t i = 0; i < series.time.size(); ++i)
      data += fmt::format("{:.6g} {:.9g}\n", series.time[i], series.rate[i][0]);
    data += "EOD\n";
    const std::string line =
        fmt::format("$v{} using 1:2 with lines {} title '{}' noenhanced", block, style, plain(title));
    ++block;
    return line;
  };
  for (const double step : spec.plot_steps) {
    std::string lines;
    for (const AccuracyRow& row : result.rows)
      if (!row.series.time.empty() && std::abs(row.step - step) < 1e-12)
        lines += (lines.empty() ? "plot " : ", ") + add(row.series, row.method, "linewidth 1");
    if (lines.empty()) continue;
    if (result.reference)
      lines += ", " + add(*result.reference, "reference", "linecolor 'black' dashtype 2 linewidth 2");
    plots += fmt::format("set title 'step {:g} ms'\n{}\n", 1e3 * step, lines);
  }
  if (plots.empty()) return "";
  return data +
         fmt::format(
             "unset logscale\nset format '%g'\nset xlabel 'time [s]'\nset ylabel 'rate [{}/s]'\nset key "
             "outside right font ',8'\n",
             result.unit) +
         "do for [t in 'png svg'] {\n  set output 'velocity.'.t\n  if (t eq 'png') { set terminal pngcairo "
         "size 1400,900 } else { set terminal svg size 1400,900 }\n"
         "  set multiplot layout " +
         std::to_string(std::max<std::size_t>(1, spec.plot_steps.size())) + ",1\n" + plots +
         "  unset multiplot\n  unset output\n}\n";
}

std::string script(const AccuracySpec& spec, const AccuracyResult& result) {
  const std::string each =
      "do for [t in 'png svg'] {{\n  set output '{0}.'.t\n  if (t eq 'png') {{ set terminal pngcairo size "
      "1200,800 }} else {{ set terminal svg size 1200,800 }}\n{1}  unset output\n}}\n";
  std::string out = "set encoding utf8\n" + blocks(spec, result);
  out += "set logscale xy\nset format '10^{%L}'\nset grid\nset key outside right\n";
  out += fmt::format(
      "set title \"{}\"\nset xlabel 'CPU seconds per simulated second'\nset ylabel 'RMS rate error over the "
      "whole run [{}/s]'\n",
      "error against cost", result.unit);
  out += fmt::format(fmt::runtime(each), "error_cost", plot_of(spec, result, "4:2"));
  out +=
      "set xlabel 'step [s]'\nset ylabel 'CPU seconds per simulated second'\nset title 'cost against step'\n";
  out += fmt::format(fmt::runtime(each), "cost_step", plot_of(spec, result, "1:4"));
  out +=
      fmt::format("set ylabel 'RMS rate error up to {:g} s [{}/s]'\nset title 'early error against step'\n",
                  spec.early, result.unit);
  out += fmt::format(fmt::runtime(each), "error_step", plot_of(spec, result, "1:3"));
  return out + velocity_plots(spec, result);
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

bool write_accuracy(const AccuracySpec& spec, const AccuracyResult& result,
                    const std::filesystem::path& out) {
  output::make_folder(out);
  output::write_file(out / "accuracy.csv", csv(result));
  output::write_file(out / "accuracy.json", json(spec, result));
  output::write_file(out / "accuracy.gp", script(spec, result));
  // The folder's name reaches the shell in the environment, where it cannot be taken for a command.
  setenv("HANDSIM_PLOT_FOLDER", out.c_str(), 1);
  return std::system(
             "cd \"$HANDSIM_PLOT_FOLDER\" && gnuplot accuracy.gp 2>gnuplot.log && rm -f gnuplot.log") == 0;
}

}  // namespace handsim::study
