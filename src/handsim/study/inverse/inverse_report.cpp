#include <algorithm>
#include <functional>
#include <map>

#include <fmt/format.h>

#include "handsim/core/units.h"
#include "handsim/output/table/gnuplot.h"
#include "handsim/output/table/table_files.h"
#include "handsim/study/inverse/inverse.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {

/// Panels of each hand's active torques in torques.sto, which has three columns for each axis after the time.
std::map<std::string, std::vector<output::Panel>> panels_of(const InverseResult& result) {
  std::map<std::string, std::vector<std::string>> names;
  std::map<std::string, std::vector<std::size_t>> columns;
  for (std::size_t i = 0; i < result.axes.size(); ++i) {
    const std::string& name = result.axes[i].name;
    const std::string hand = name.substr(0, name.find('.'));
    names[hand].push_back(name.substr(hand.size() + 1));
    columns[hand].push_back(4 + 3 * i);
  }
  std::map<std::string, std::vector<output::Panel>> out;
  for (const auto& [hand, axes] : names)
    out[hand] =
        output::hand_panels(axes, [&hand = hand, &axes = axes, &columns](std::size_t i, const char* colour) {
          return fmt::format("data skip 7 using 1:{} with lines lw 1.4 lc rgb '{}' title '{}'",
                             columns[hand][i], colour, axes[i]);
        });
  return out;
}

/// A column of panels for each hand.
Plot torque_plot(const scene::Scene& scene, const InverseResult& result) {
  const auto hands = panels_of(result);
  std::size_t rows = 0;
  for (const auto& [hand, panels] : hands) rows = std::max(rows, panels.size());
  std::string commands = fmt::format(
      "  set multiplot layout {},{} columnsfirst downwards title '{}: torques of inverse dynamics'\n"
      "set autoscale xfix\nset grid lc rgb '#d0d0d0'\nset key outside right top samplen 1.5\nset lmargin 11\n"
      "set rmargin 27\nset ylabel 'torque [N m]'\n",
      rows, hands.size(), output::plot_text(scene.spec.title));
  for (const auto& [hand, panels] : hands)
    for (std::size_t i = 0; i < rows; ++i)
      // A hand with fewer panels than the other leaves places empty.
      commands += i < panels.size()
                      ? fmt::format("set xlabel '{}'\nset title '{} {}'\n{}", i + 1 == rows ? "time [s]" : "",
                                    hand, panels[i].part, panels[i].commands)
                      : "set multiplot next\n";
  return {"torques",
          fmt::format("noenhanced size {},{} font 'DejaVu Sans,10'", hands.size() > 1 ? 1500 : 1000,
                      60 + 180 * rows),
          commands + "  unset multiplot\n"};
}

/// In degrees; nothing for what was not measured.
std::string degrees(const std::optional<double>& angle, const char* format, const char* absent) {
  return angle ? fmt::format(fmt::runtime(format), kDegreesPerRadian * *angle) : absent;
}

std::string summary_csv(const InverseResult& result) {
  std::string out =
      "axis,largest_torque[N_m],rms_torque[N_m],rms_error[deg],largest_error[deg],largest_reserve[N_m],"
      "rms_reserve[N_m]\n";
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
    for (const char* part : {"_total", "_passive", "_active"}) names.push_back(axis.name + part);
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
               [of = of](const InverseRow& row, std::vector<double>& to) { to = row.*of; });
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
  if (input.least_activation) out["least_activation"] = *input.least_activation;
  if (result.reserve_share) out["reserve_share"] = *result.reserve_share;
  if (result.reserve_share && result.undone)
    out["undone"] = {{"beyond_strength", result.undone->beyond},
                     {"no_balance", result.undone->no_balance},
                     {"faster_than_muscles", result.undone->late},
                     {"other", result.undone->other}};
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
