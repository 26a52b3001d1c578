#include "handsim/study/effects/effects.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/units.h"
#include "handsim/output/output_folder.h"
#include "handsim/output/table/gnuplot.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {

/// `object_contact with friction`.
std::string label(const EffectRow& row) {
  std::string out = row.name;
  for (const model::Effect effect : row.with) out += " with " + std::string(model::name(effect));
  return out;
}

std::string where(const simulation::Peak& peak) {
  return peak.value > 0 ? fmt::format("{} at {:.3g} s", peak.where, peak.time) : "";
}

Json peak_json(const simulation::Peak& peak, double value) {
  Json out = {{"value", value}};
  if (peak.value > 0) out.update({{"where", peak.where}, {"time_s", peak.time}});
  return out;
}

Fields fields_of(const EffectRow& row, bool has_angles) {
  Fields out = {{"effect_taken_away", "", label(row)}, {"", "effect", row.name}, {"", "with", Json::array()}};
  for (const model::Effect effect : row.with) out.back().value.push_back(model::name(effect));
  if (row.fault) {
    out.push_back({"note", "fault", *row.fault});
    return out;
  }
  const double angle = kDegreesPerRadian * row.angle.value, moved = 1e3 * row.displacement.value;
  out.insert(out.end(), {{"cpu_per_step", "cpu_ns_per_step", row.ns_per_step},
                         {"saved_per_step", "saved_ns_per_step", row.saved_ns},
                         {"noise", "noise_ns", row.noise_ns}});
  if (has_angles)
    out.insert(out.end(), {{"angle_largest", "", angle},
                           {"", "angle_largest_deg", peak_json(row.angle, angle)},
                           {"angle_rms", "angle_rms_deg", kDegreesPerRadian * row.angle_rms}});
  out.insert(out.end(), {{"displacement_largest", "", moved},
                         {"", "displacement_largest_mm", peak_json(row.displacement, moved)},
                         {"angle_where", "", where(row.angle)},
                         {"displacement_where", "", where(row.displacement)}});
  return out;
}

/// Three significant digits, without an exponent below 1e6.
std::string figure(double value) {
  return std::abs(value) >= 1000 && std::abs(value) < 1e6 ? fmt::format("{:.0f}", value)
                                                          : fmt::format("{:.3g}", value);
}

/// Range of a logarithmic axis; its lower end is so low that the smallest bar is visible.
struct Decades {
  double low = 0.1, high = 1;
};

Decades decades(const std::vector<double>& values) {
  double low = INFINITY, high = 0;
  for (const double value : values)
    if (value > 0) low = std::min(low, value), high = std::max(high, value);
  if (high == 0) return {};
  return {std::pow(10, std::floor(std::log10(low) - 0.3)), std::pow(10, std::ceil(std::log10(high) + 0.3))};
}

/// Height of a bar, position of its label, and the label; a logarithmic axis cannot show 0.
std::string bar(double value, const Decades& axis) {
  return value > 0 ? fmt::format("{} {} \"{}\"", value, value, figure(value))
                   : fmt::format("NaN {} \"0\"", axis.low);
}

/// A panel of bars for differences, with a logarithmic axis.
std::string panel(const char* title, const char* unit, int column, const Decades& axis) {
  return fmt::format(
      "set title '{0}'\nset ylabel '{1}'\nset logscale y\nset format y '%g'\nset yrange [{3}:{4}]\n"
      "plot $rows using 0:{2}:xtic(1) with boxes linecolor rgb '#c8553d' notitle, '' using 0:{5}:{6} with "
      "labels offset 0,0.7 notitle\n",
      title, unit, column, axis.low, axis.high, column + 1, column + 2);
}

/// Bars of cost and difference, one for each effect.
void add_plot(const scene::Scene& scene, const EffectsResult& result, Report& report) {
  std::vector<const EffectRow*> rows;
  std::vector<double> angles, displacements;
  double top = 0, bottom = 0;
  for (const EffectRow& row : result.rows) {
    if (row.fault) continue;
    rows.push_back(&row);
    angles.push_back(kDegreesPerRadian * row.angle.value);
    displacements.push_back(1e3 * row.displacement.value);
    top = std::max(top, 1e-3 * (row.saved_ns + row.noise_ns));
    bottom = std::min(bottom, 1e-3 * (row.saved_ns - row.noise_ns));
  }
  if (rows.empty()) return;
  const Decades of_angles = decades(angles), of_displacements = decades(displacements);
  report.data = "$rows << EOD\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::string name = label(*rows[i]);
    if (const std::size_t at = name.find(" with "); at != std::string::npos) name.replace(at, 1, "\\n");
    const double saved = 1e-3 * rows[i]->saved_ns;
    report.data += fmt::format("\"{}\" {} {} {} \"{:.3g}\" {} {}\n", name, saved, 1e-3 * rows[i]->noise_ns,
                               std::max(0.0, saved + 1e-3 * rows[i]->noise_ns), saved,
                               bar(angles[i], of_angles), bar(displacements[i], of_displacements));
  }
  report.data += "EOD\n";
  const double room = std::max(1e-3, top - bottom);
  std::string plots = fmt::format(
      "set title 'cost: CPU time of a step, of {:.3g} µs in all'\nset ylabel 'saved without it [µs]'\n"
      "unset logscale\nset format y '%g'\nset yrange [{}:{}]\nset xtics font ',9'\n"
      "plot $rows using 0:2:3:xtic(1) with boxerrorbars linecolor rgb '#1b6ca8' notitle, "
      "'' using 0:4:5 with labels offset 0,0.7 notitle\n",
      1e-3 * result.ns_per_step, bottom - 0.05 * room, top + 0.15 * room);
  if (result.has_angles)
    plots += panel("influence: largest difference of a joint angle", "without it [deg]", 6, of_angles);
  plots += panel("influence: largest difference of a position", "without it [mm]", 9, of_displacements);
  const int panels = result.has_angles ? 3 : 2;
  report.plots.push_back(
      {"effects", fmt::format("noenhanced size 1000,{} font 'DejaVu Sans,10'", 60 + 300 * panels),
       fmt::format("  set multiplot layout {},1 title '{}: without each effect in turn'\n"
                   "set style fill solid 0.8 border linecolor 'black'\nset boxwidth 0.6\nset grid y\n"
                   "set xrange [-0.6:{}]\nset lmargin 12\n{}  unset multiplot\n",
                   panels, output::plot_text(scene.spec.title), static_cast<double>(rows.size()) - 0.4,
                   plots)});
}

StudyCommands effects_commands(const std::string& file, std::vector<std::string> overrides,
                               const EffectsResult& result) {
  StudyCommands out{command_text({"effects", file}, overrides)};
  std::vector<std::string>& rows = out.rows["effects.csv"];
  rows.push_back(command_text({"run", file}, overrides));
  overrides.emplace_back();
  for (const EffectRow& row : result.rows) {
    overrides.back() = row.set;
    rows.push_back(row.set.empty() || row.fault ? "" : command_text({"run", file}, overrides));
  }
  return out;
}

/// For the screen.
std::string table(const EffectsResult& result) {
  std::string out = fmt::format("{:<30} {:>11} {:>11} {:>9} {:>7} {:>11} {:>9} {:>12}  {}\n",
                                "without effect", "ns per step", "saved ns", "+-", "saved", "angle deg",
                                "RMS deg", "position mm", "largest differences at");
  out += fmt::format("{:<30} {:>11.0f}\n", "none", result.ns_per_step);
  for (const EffectRow& row : result.rows) {
    if (row.fault) {
      out += fmt::format("{:<30} {}\n", label(row), *row.fault);
      continue;
    }
    const auto angle = [&](double value) {
      return result.has_angles ? fmt::format("{:.3g}", kDegreesPerRadian * value) : std::string("-");
    };
    std::string places = where(row.angle);
    if (row.displacement.value > 0) places += (places.empty() ? "" : "; ") + where(row.displacement);
    out += fmt::format("{:<30} {:>11.0f} {:>11.0f} {:>9.0f} {:>6.1f}% {:>11} {:>9} {:>12}  {}\n", label(row),
                       row.ns_per_step, row.saved_ns, row.noise_ns, 100 * row.saved_ns / result.ns_per_step,
                       angle(row.angle.value), angle(row.angle_rms), figure(1e3 * row.displacement.value),
                       places.empty() ? "identical motion" : places);
  }
  return out;
}

/// CSV and JSON. The first row of CSV is the whole scene.
Report report_of(const scene::Scene& scene, const EffectsResult& result) {
  std::vector<Fields> rows;
  for (const EffectRow& row : result.rows) rows.push_back(fields_of(row, result.has_angles));
  Json json = {{"title", scene.spec.title},
               {"cpu_ns_per_step", result.ns_per_step},
               {"steps", result.steps},
               {"step_s", scene.spec.solver.step},
               {"repeats", result.repeats}};
  add_origin(json);
  json["rows"] = json_table(rows);
  rows.insert(rows.begin(),
              {{"effect_taken_away", "", "none", 1, "{}"}, {"cpu_per_step", "", result.ns_per_step}});
  return {csv_table("effect_taken_away,cpu_per_step[ns],saved_per_step[ns],noise[ns],angle_largest[deg],"
                    "angle_rms[deg],displacement_largest[mm],angle_where,displacement_where,note",
                    rows),
          json.dump(2) + "\n",
          {},
          {}};
}

}  // namespace

StudyEnd effects(const scene::Scene& scene, const EffectsOptions& options, const StudyRun& run) {
  const output::OutputFolder folder(run.out, report_files("effects", {"effects"}),
                                    [&] { return scene::files_read(scene); });
  const EffectsResult result = run_effects(scene, options.repeats, run.progress);
  folder.clear();
  StudyEnd end{
      fmt::format("{}\nWithout each effect in turn: CPU time of a step, and change of the motion over "
                  "{:g} s. Median of {} rounds; +-: half their interquartile range.\n\n{}\n",
                  scene.spec.title, scene.spec.duration, result.repeats, table(result))};
  Report report = report_of(scene, result);
  add_plot(scene, result, report);
  end.plotted = write_report(run.out, "effects", report);
  end.json = std::move(report.json);
  if (options.file)
    finish_study(run.out, effects_commands(options.file->string(), options.overrides, result), run.report);
  return end;
}

}  // namespace handsim::study
