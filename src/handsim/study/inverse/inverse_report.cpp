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

std::string degrees(const std::optional<double>& angle) {
  return angle ? fmt::format("{:.3g}", kDegreesPerRadian * *angle) : "not checked";
}

std::vector<Fields> fields_of(const InverseResult& result) {
  std::vector<Fields> out;
  for (const InverseAxis& axis : result.axes) {
    Fields& row = out.emplace_back(Fields{{"axis", "axis", axis.name, 1, "{}"},
                                          {"largest_torque", "largest_torque_Nm", axis.largest_torque},
                                          {"rms_torque", "rms_torque_Nm", axis.rms_torque}});
    if (axis.rms_error && axis.largest_error)
      row.insert(row.end(),
                 {{"rms_error", "forward_rms_error_deg", kDegreesPerRadian * *axis.rms_error},
                  {"largest_error", "forward_largest_error_deg", kDegreesPerRadian * *axis.largest_error}});
    if (axis.largest_reserve)
      row.insert(row.end(), {{"largest_reserve", "largest_reserve_Nm", *axis.largest_reserve},
                             {"rms_reserve", "rms_reserve_Nm", *axis.rms_reserve}});
  }
  return out;
}

/// Numbers by step.
void write_rows(const std::filesystem::path& file, output::MotionHead head, const InverseResult& result,
                const std::function<void(const InverseRow&, std::vector<double>&)>& add) {
  head.most_rows = result.rows.size();
  output::MotionTableWriter table(file, head);
  std::vector<double> values;
  for (const InverseRow& row : result.rows) {
    values.clear();
    add(row, values);
    if (values.empty()) break;
    table.add(row.time, values);
  }
  table.finish();
}

void write_tables(const scene::Scene& scene, const InverseResult& result, bool forward,
                  const std::filesystem::path& out) {
  const std::string& title = scene.spec.title;
  std::vector<std::string> names, axes, muscles;
  for (const InverseAxis& axis : result.axes) {
    for (const char* part : {"_total", "_passive", "_active"}) names.push_back(axis.name + part);
    axes.push_back(axis.name);
  }
  write_rows(out / "torques.sto", {title + ": torques about the joint axes [N m]", names, 0, false}, result,
             [&](const InverseRow& row, std::vector<double>& to) {
               for (const InverseAxis& axis : result.axes)
                 to.insert(to.end(), {row.moment[axis.dof], row.passive[axis.dof], row.active(axis.dof)});
             });
  // The angles whose torques these are, and those of the check, on the same steps.
  for (const auto& [name, angles] :
       {std::pair("motion.mot", &InverseRow::q), {"forward.mot", &InverseRow::forward}})
    if (angles == &InverseRow::q || forward)
      write_rows(out / name, {title, axes}, result,
                 [&, of = angles](const InverseRow& row, std::vector<double>& to) {
                   if (!(row.*of).empty())
                     for (const InverseAxis& axis : result.axes)
                       to.push_back(kDegreesPerRadian * (row.*of)[axis.dof]);
                 });
  if (result.rows.empty() || result.rows[0].reserve.empty()) return;
  for (const model::Muscle& muscle : scene.model.muscles) muscles.push_back(muscle.name);
  for (const auto& [name, of] :
       {std::pair("activations", &InverseRow::activation), std::pair("excitations", &InverseRow::excitation)})
    write_rows(out / fmt::format("{}.sto", name), {title + ": " + name, muscles, 0, false}, result,
               [of = of](const InverseRow& row, std::vector<double>& to) { to = row.*of; });
  write_rows(out / "reserves.sto", {title + ": torques that the muscles leave undone [N m]", axes, 0, false},
             result, [&](const InverseRow& row, std::vector<double>& to) {
               for (const InverseAxis& axis : result.axes) to.push_back(row.reserve[axis.dof]);
             });
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
  out["axes"] = json_table(fields_of(result));
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
                       axis.rms_torque, degrees(axis.rms_error), degrees(axis.largest_error));
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
  write_tables(scene, result, input.forward, out);
  Report report{csv_table("axis,largest_torque[N_m],rms_torque[N_m],rms_error[deg],largest_error[deg],"
                          "largest_reserve[N_m],rms_reserve[N_m]",
                          fields_of(result)),
                inverse_json(scene, input, result),
                "data = 'torques.sto'\nset datafile separator '\\t'\n",
                {torque_plot(scene, result)}};
  return write_report(out, "summary", report);
}

}  // namespace handsim::study
