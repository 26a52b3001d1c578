#include <algorithm>
#include <functional>
#include <map>

#include <fmt/format.h>

#include "handsim/core/units.h"
#include "handsim/output/table/gnuplot.h"
#include "handsim/output/table/motion_table.h"
#include "handsim/study/inverse/inverse.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {

constexpr const char* kGroups[] = {"wrist", "thumb", "index", "middle", "ring", "little"};
constexpr const char* kColours[] = {"#1b6ca8", "#c8553d", "#3a7d44", "#8e5ea2", "#b8860b"};

/// Columns of torques.sto: time, then three for each axis.
std::size_t column_of(std::size_t axis) { return 2 + 3 * axis; }

/// Axes of a panel: `right index`.
using Panels = std::map<std::pair<std::string, std::size_t>, std::vector<std::size_t>>;

Panels panels_of(const InverseResult& result) {
  Panels out;
  for (std::size_t i = 0; i < result.axes.size(); ++i) {
    const std::string& name = result.axes[i].name;
    const std::size_t dot = name.find('.');
    for (std::size_t g = 0; g < std::size(kGroups); ++g)
      if (name.compare(dot + 1, std::string_view(kGroups[g]).size(), kGroups[g]) == 0)
        out[{name.substr(0, dot), g}].push_back(i);
  }
  return out;
}

std::string panel(const InverseResult& result, const std::vector<std::size_t>& axes) {
  std::string out;
  for (std::size_t k = 0; k < axes.size(); ++k)
    out += fmt::format("{}data skip 7 using 1:{} with lines lw 1.4 lc rgb '{}' title '{}'", k > 0 ? ", " : "",
                       column_of(axes[k]) + 2, kColours[k % std::size(kColours)],
                       result.axes[axes[k]].name.substr(result.axes[axes[k]].name.find('.') + 1));
  return out;
}

/// A column of panels for each hand.
Plot torque_plot(const scene::Scene& scene, const InverseResult& result) {
  const Panels panels = panels_of(result);
  std::map<std::string, std::size_t> of_hand;
  std::size_t rows = 0;
  for (const auto& [key, axes] : panels) rows = std::max(rows, ++of_hand[key.first]);
  std::string commands = fmt::format(
      "  set multiplot layout {},{} columnsfirst downwards title '{}: torques of inverse dynamics'\n"
      "set autoscale xfix\nset grid lc rgb '#d0d0d0'\nset key outside right top samplen 1.5\nset lmargin 11\n"
      "set rmargin 27\nset ylabel 'torque [N m]'\n",
      rows, of_hand.size(), output::plot_text(scene.spec.title));
  std::string hand;
  std::size_t left = 0;
  for (const auto& [key, axes] : panels) {
    // A hand with fewer panels than the other leaves places empty.
    for (; left > 0 && key.first != hand; --left) commands += "set multiplot next\n";
    if (left == 0) left = rows;
    hand = key.first;
    commands += fmt::format("set xlabel '{}'\nset title '{} {}'\nplot {}\n", --left == 0 ? "time [s]" : "",
                            key.first, kGroups[key.second], panel(result, axes));
  }
  return {"torques",
          fmt::format("noenhanced size {},{} font 'DejaVu Sans,10'", of_hand.size() > 1 ? 1500 : 1000,
                      60 + 180 * rows),
          commands + "  unset multiplot\n"};
}

/// In degrees; nothing for what was not measured.
std::string degrees(const std::optional<double>& angle, const char* format, const char* absent) {
  return angle ? fmt::format(fmt::runtime(format), kDegreesPerRadian * *angle) : absent;
}

std::string summary_csv(const InverseResult& result) {
  std::string out =
      "axis,largest_torque[N_m],rms_torque[N_m],rms_error[deg],largest_error[deg],largest_reserve[N_m],rms_"
      "reserve[N_"
      "m]\n";
  const auto number = [](const std::optional<double>& x) { return x ? fmt::format("{}", *x) : ""; };
  for (const InverseAxis& axis : result.axes)
    out += fmt::format("{},{},{},{},{},{},{}\n", axis.name, axis.largest_torque, axis.rms_torque,
                       degrees(axis.rms_error, "{}", ""), degrees(axis.largest_error, "{}", ""),
                       number(axis.largest_reserve), number(axis.rms_reserve));
  return out;
}

/// Numbers by step that are neither angles nor read as such.
void write_rows(const std::filesystem::path& file, const std::string& title, std::vector<std::string> names,
                const InverseResult& result,
                const std::function<void(const InverseRow&, std::vector<double>&)>& add) {
  output::MotionHead head{title, std::move(names), result.rows.size()};
  head.degrees = false;
  output::MotionTableWriter table(file, head);
  std::vector<double> values;
  for (const InverseRow& row : result.rows) {
    values.clear();
    add(row, values);
    table.add(row.time, values);
  }
  table.finish();
}

void write_torques(const scene::Scene& scene, const InverseResult& result, const std::filesystem::path& out) {
  std::vector<std::string> names, axes, muscles;
  for (const InverseAxis& axis : result.axes) {
    for (const char* part : {"_moment", "_passive", "_active"}) names.push_back(axis.name + part);
    axes.push_back(axis.name);
  }
  write_rows(out / "torques.sto", scene.spec.title + ": torques about the joint axes [N m]", names, result,
             [&](const InverseRow& row, std::vector<double>& to) {
               for (const InverseAxis& axis : result.axes)
                 to.insert(to.end(), {row.moment[axis.dof], row.passive[axis.dof], row.active(axis.dof)});
             });
  if (result.rows.empty() || result.rows[0].reserve.empty()) return;
  for (const model::Muscle& muscle : scene.model.muscles) muscles.push_back(muscle.name);
  for (const auto& [name, of] :
       {std::pair("activations", &InverseRow::activation), std::pair("excitations", &InverseRow::excitation)})
    write_rows(out / fmt::format("{}.sto", name), scene.spec.title + ": " + name, muscles, result,
               [&](const InverseRow& row, std::vector<double>& to) { to = row.*of; });
  write_rows(out / "reserves.sto", scene.spec.title + ": torques that the muscles leave undone [N m]", axes,
             result, [&](const InverseRow& row, std::vector<double>& to) {
               for (const InverseAxis& axis : result.axes) to.push_back(row.reserve[axis.dof]);
             });
}

/// The angles whose torques these are, and those of the check, on the same steps.
void write_motion(const scene::Scene& scene, const InverseResult& result, const char* name,
                  const std::filesystem::path& out, const std::vector<double> InverseRow::*angles) {
  output::MotionHead head{scene.spec.title, {}, result.rows.size()};
  for (const InverseAxis& axis : result.axes) head.names.push_back(axis.name);
  output::MotionTableWriter table(out / name, head);
  std::vector<double> values;
  for (const InverseRow& row : result.rows) {
    if ((row.*angles).empty()) break;
    values.clear();
    for (const InverseAxis& axis : result.axes) values.push_back(kDegreesPerRadian * (row.*angles)[axis.dof]);
    table.add(row.time, values);
  }
  table.finish();
}

}  // namespace

std::string inverse_json(const scene::Scene& scene, const InverseInput& input, const InverseResult& result) {
  Json out = {{"title", scene.spec.title},
              {"motion", input.motion ? input.motion->filename().string() : "programs of the scene"},
              {"step_s", scene.spec.solver.step},
              {"steps", result.rows.size()}};
  if (result.cutoff)
    out["filter"] = {{"kind", "Butterworth, second order, forwards and backwards"},
                     {"cutoff_hz", *result.cutoff}};
  if (input.loads) out["loads"] = input.loads->filename().string();
  if (result.rms_error) {
    out["forward"] = {{"engine", engine::name(scene.spec.solver.engine())},
                      {"rms_error_deg", kDegreesPerRadian * *result.rms_error},
                      {"limit_deg", kDegreesPerRadian * kLargestCheckError},
                      {"passed", result.agrees()}};
    if (result.fault) out["forward"]["fault"] = *result.fault;
  }
  add_origin(out);
  out["axes"] = Json::array();
  for (const InverseAxis& axis : result.axes) {
    Json entry = {
        {"axis", axis.name}, {"largest_torque_Nm", axis.largest_torque}, {"rms_torque_Nm", axis.rms_torque}};
    if (axis.rms_error && axis.largest_error) {
      entry["forward_rms_error_deg"] = kDegreesPerRadian * *axis.rms_error;
      entry["forward_largest_error_deg"] = kDegreesPerRadian * *axis.largest_error;
    }
    if (axis.largest_reserve) {
      entry["largest_reserve_Nm"] = *axis.largest_reserve;
      entry["rms_reserve_Nm"] = *axis.rms_reserve;
    }
    out["axes"].push_back(std::move(entry));
  }
  out["warnings"] = result.warnings;
  return out.dump(2) + "\n";
}

std::string inverse_table(const InverseResult& result) {
  const bool muscles = !result.axes.empty() && result.axes[0].largest_reserve;
  std::string out =
      fmt::format("{:<28} {:>12} {:>12} {:>14} {:>14}{}\n", "axis", "largest N m", "RMS N m", "check RMS deg",
                  "largest deg", muscles ? "  reserve N m, largest and RMS" : "");
  for (const InverseAxis& axis : result.axes) {
    out += fmt::format("{:<28} {:>12.4g} {:>12.4g} {:>14} {:>14}", axis.name, axis.largest_torque,
                       axis.rms_torque, degrees(axis.rms_error, "{:.3g}", "not checked"),
                       degrees(axis.largest_error, "{:.3g}", "not checked"));
    out += muscles ? fmt::format(" {:>14.4g} {:>14.4g}\n", *axis.largest_reserve, *axis.rms_reserve) : "\n";
  }
  return out;
}

std::vector<std::string> inverse_files() {
  std::vector<std::string> out = report_files("summary", {"torques"});
  out.insert(out.end(), {"torques.sto", "motion.mot", "forward.mot", "activations.sto", "excitations.sto",
                         "reserves.sto"});
  return out;
}

bool write_inverse(const scene::Scene& scene, const InverseInput& input, const InverseResult& result,
                   const std::filesystem::path& out) {
  write_torques(scene, result, out);
  write_motion(scene, result, "motion.mot", out, &InverseRow::q);
  if (input.forward) write_motion(scene, result, "forward.mot", out, &InverseRow::forward);
  Report report{summary_csv(result),
                inverse_json(scene, input, result),
                "data = 'torques.sto'\nset datafile separator '\\t'\n",
                {torque_plot(scene, result)}};
  return write_report(out, "summary", report);
}

}  // namespace handsim::study
