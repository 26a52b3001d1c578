#include "handsim/simulation/run/run.h"

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/table/gnuplot.h"

namespace handsim::simulation {

namespace {

constexpr const char* kRemedy = "gnuplot (apt-get install gnuplot-nox), or a run without --plots";

struct PlotKind {
  const char* file;
  const char* title;
  const char* axis;
  /// Columns {0} target, {1} angle, {2} torque of control.sto (six head lines); {3} colour, {4} title.
  const char* curve;
};
constexpr PlotKind kKinds[] = {{"angles", "joint angles; dashed: targets", "angle [deg]",
                                "data skip 7 using 1:{1} with lines lw 1.6 lc rgb '{3}' title '{4}', data "
                                "skip 7 using 1:{0} with lines dt 2 lw 1.2 lc rgb '#202020' notitle"},
                               {"errors", "target minus angle", "error [deg]",
                                "data skip 7 using 1:(${0}-${1}) with lines lw 1.2 lc rgb '{3}' title '{4}'"},
                               {"torques", "joint torques", "torque [N m]",
                                "data skip 7 using 1:{2} with lines lw 1.2 lc rgb '{3}' title '{4}'"}};

std::vector<output::Panel> panels(const control::Plan& plan, std::size_t hand, const PlotKind& kind) {
  std::vector<std::string> names;
  std::vector<std::size_t> columns;  // of control.sto, of the target
  for (std::size_t i = 0; i < plan.axes.size(); ++i) {
    if (plan.axes[i].hand != hand) continue;
    names.push_back(plan.axes[i].name.substr(plan.hands[hand].name.size() + 1));
    columns.push_back(2 + 3 * i);
  }
  return output::hand_panels(names, [&](std::size_t i, const char* colour) {
    // `mcp flexion` of `index_mcp.flexion`.
    const std::size_t joint = names[i].find_first_of("_.");
    std::string label = names[i][joint] == '_' ? names[i].substr(joint + 1) : names[i];
    std::replace_if(
        label.begin(), label.end(), [](char c) { return c == '.' || c == '_'; }, ' ');
    return fmt::format(fmt::runtime(kind.curve), columns[i], columns[i] + 1, columns[i] + 2, colour, label);
  });
}

std::string script(const scene::Scene& scene, std::size_t hand, const PlotKind& kind) {
  const control::Plan& plan = *scene.control;
  const std::string& name = plan.hands[hand].name;
  const std::vector<output::Panel> groups = panels(plan, hand, kind);
  std::string out = fmt::format(
      "# gnuplot {0}_{1}.gp\n{8}data = '../control.sto'\n"
      "set datafile separator '\\t'\n"
      "set terminal pngcairo noenhanced size 1600,{2} font 'DejaVu Sans,10'\n"
      "set output place('{0}_{1}.png')\n"
      "set multiplot layout {3},1 title '{4} hand: {5} ({6})'\n"
      "set autoscale xfix\nset grid lc rgb '#d0d0d0'\nset key outside right top\nset lmargin 10\nset rmargin "
      "22\nset ylabel '{7}'\n",
      name, kind.file, 60 + 250 * groups.size(), groups.size(), name, kind.title,
      output::plot_text(scene.spec.title), kind.axis, output::kPlotHead);
  for (const output::Panel& panel : groups)
    out += fmt::format("{}set title '{}'\n{}", &panel == &groups.back() ? "set xlabel 'time [s]'\n" : "",
                       panel.part, panel.commands);
  return out + "unset multiplot\n";
}

}  // namespace

void need_gnuplot() {
  if (!output::has_gnuplot()) throw input_error("--plots", "no gnuplot that starts", kRemedy);
}

void write_plots(const scene::Scene& scene, const std::filesystem::path& out) {
  const std::filesystem::path folder = out / "plots";
  output::make_folder(folder);
  for (std::size_t hand = 0; hand < scene.control->hands.size(); ++hand)
    for (const PlotKind& kind : kKinds) {
      const std::string name = scene.control->hands[hand].name + "_" + kind.file;
      output::write_file(folder / (name + ".gp"), script(scene, hand, kind));
      if (!output::plot(name + ".gp", folder, {name + ".png"}))
        throw output_error("--plots", "gnuplot failing on " + (folder / (name + ".gp")).string(),
                           "memory, and room on the disk");
    }
}

}  // namespace handsim::simulation
