#include "handsim/simulation/run/plots.h"

#include <map>

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
  /// What is drawn of a joint axis: columns {0} target, {1} angle and {2} torque of control.sto (OpenSim's
  /// header has six lines, then the labels), {3} colour, {4} title.
  const char* curve;
};
constexpr PlotKind kKinds[] = {{"angles", "joint angles; dashed: targets", "angle [deg]",
                                "data skip 7 using 1:{1} with lines lw 1.6 lc rgb '{3}' title '{4}', "
                                "data skip 7 using 1:{0} with lines dt 2 lw 1.2 lc rgb '#202020' notitle"},
                               {"errors", "target minus angle", "error [deg]",
                                "data skip 7 using 1:(${0}-${1}) with lines lw 1.2 lc rgb '{3}' title '{4}'"},
                               {"torques", "joint torques", "torque [N m]",
                                "data skip 7 using 1:{2} with lines lw 1.2 lc rgb '{3}' title '{4}'"}};

/// Axes of a hand that share a panel: a finger, or the wrist.
std::map<std::string, std::vector<std::size_t>> panels(const control::Plan& plan, std::size_t hand) {
  std::map<std::string, std::vector<std::size_t>> out;
  for (std::size_t i = 0; i < plan.axes.size(); ++i) {
    if (plan.axes[i].hand != hand) continue;
    const std::string name = plan.axes[i].name.substr(plan.hands[hand].name.size() + 1);
    out[name.substr(0, name.find_first_of("_."))].push_back(i);
  }
  return out;
}

/// `mcp flexion` of `right.index_mcp.flexion`.
std::string label(const control::DrivenAxis& axis, const std::string& hand, const std::string& panel) {
  std::string out = axis.name.substr(hand.size() + 1);
  if (out.starts_with(panel + "_")) out = out.substr(panel.size() + 1);
  for (char& c : out)
    if (c == '.' || c == '_') c = ' ';
  return out;
}

constexpr const char* kColours[] = {"#1b6ca8", "#c8553d", "#3a7d44", "#8e5ea2", "#b8860b"};

std::string curves(const control::Plan& plan, const std::vector<std::size_t>& axes, const std::string& hand,
                   const std::string& panel, const PlotKind& kind) {
  std::string out;
  int colour = 0;
  for (const std::size_t i : axes) {
    const std::size_t target = 2 + 3 * i;
    out += (out.empty() ? "" : ", ") + fmt::format(fmt::runtime(kind.curve), target, target + 1, target + 2,
                                                   kColours[colour++ % 5], label(plan.axes[i], hand, panel));
  }
  return out;
}

std::string script(const scene::Scene& scene, std::size_t hand, const PlotKind& kind) {
  const control::Plan& plan = *scene.control;
  const std::string& name = plan.hands[hand].name;
  const auto groups = panels(plan, hand);
  std::string out = fmt::format(
      "# gnuplot {0}_{1}.gp\n{8}"
      "data = '../control.sto'\n"
      "set datafile separator '\\t'\n"
      "set terminal pngcairo noenhanced size 1600,{2} font 'DejaVu Sans,10'\n"
      "set output place('{0}_{1}.png')\n"
      "set multiplot layout {3},1 title '{4} hand: {5} ({6})'\n"
      "set autoscale xfix\nset grid lc rgb '#d0d0d0'\nset key outside right top\nset lmargin 10\nset rmargin "
      "22\nset ylabel "
      "'{7}'\n",
      name, kind.file, 60 + 250 * groups.size(), groups.size(), name, kind.title,
      output::plot_text(scene.spec.title), kind.axis, output::kPlotHead);
  std::size_t left = groups.size();
  for (const char* panel : {"wrist", "thumb", "index", "middle", "ring", "little"}) {
    const auto found = groups.find(panel);
    if (found == groups.end()) continue;
    if (--left == 0) out += "set xlabel 'time [s]'\n";
    out += fmt::format("set title '{}'\nplot {}\n", panel, curves(plan, found->second, name, panel, kind));
  }
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
