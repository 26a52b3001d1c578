// What contacts cost with ODE's two solvers: a hand without muscle torques lies on a stack of 0 to 16 slabs,
// so that its joints and all contacts are one system. `contact_cost FOLDER` writes contacts_cost.csv and its
// plot.
#include <array>
#include <cstdio>

#include <fmt/format.h>

#include "handsim/engine/engine.h"
#include "handsim/scene/compile/scene.h"
#include "handsim/study/report.h"
#include "places.h"

namespace handsim::study {

namespace {

/// Figures of one method and one number of slabs.
struct ContactCostRow {
  std::string method;
  int slabs = 0;
  double contacts = 0;      ///< contact points, mean of the timed steps
  double ns_per_step = 0;   ///< CPU time of a step, collision detection included; median of the batches
  double iterative = 0;     ///< share of steps that quick_step solved
  double lcp_failures = 0;  ///< per step
};

struct MethodChoice {
  const char* name;
  const char* method;
  int iterations;
};
constexpr std::array kMethods = {MethodChoice{"world_step", "world_step", 20},
                                 MethodChoice{"quick_step 20", "quick_step", 20},
                                 MethodChoice{"quick_step 50", "quick_step", 50}};
constexpr std::array kHeights = {0, 1, 2, 3, 4, 6, 8, 10, 13, 16};
constexpr double kSlab = 0.02;   ///< thickness [m]
constexpr int kSettling = 1000;  ///< steps before the timed ones, in which the hand comes to rest
constexpr int kBatches = 5;
constexpr int kBatch = 20;  ///< steps in a batch

scene::Scene stack(int slabs, const MethodChoice& method) {
  std::string text = fmt::format(
      "hands: [{{model: \"{0}/handmodels/anatomical.yaml\", person: \"{0}/config/persons/median_man.yaml\", "
      "side: right, wrist: {{mount: free, position: [0, -0.09, {1}]}}}}]\n",
      test::kSourceFolder, kSlab * slabs + 0.09);
  std::string objects;
  for (int i = 0; i < slabs; ++i)
    objects += fmt::format(
        "  - {{name: slab{}, shape: box, edges: [0.25, 0.3, {}], density: 600, position: [0, 0, {}]}}\n", i,
        kSlab, kSlab * (i + 0.5));
  if (slabs > 0) text += "objects:\n" + objects;
  text += fmt::format(
      "ground: {{}}\n"
      "effects: [gravity, {}ground_contact, friction, joint_stops, passive_tissue]\n"
      "solver: {{method: {}, iterations: {}, step: 0.001, cfm: 1e-7}}\nduration: 1\n",
      slabs > 0 ? "object_contact, " : "", method.method, method.iterations);
  return scene::compile_scene(parse_yaml(text, "stack"));
}

ContactCostRow measure(int slabs, const MethodChoice& method) {
  const scene::Scene scene = stack(slabs, method);
  const auto engine = engine::make_engine(scene.model, scene.spec.solver);
  for (int i = 0; i < kSettling; ++i) engine->step({});
  ContactCostRow row;
  row.method = method.name;
  row.slabs = slabs;
  std::vector<double> times;
  for (int batch = 0; batch < kBatches; ++batch) {
    const double start = cpu_now();
    for (int i = 0; i < kBatch; ++i) {
      const engine::StepReport report = engine->step({});
      row.contacts += report.contacts;
      row.iterative += report.iterative ? 1 : 0;
      row.lcp_failures += report.lcp_failures;
    }
    times.push_back(1e9 * (cpu_now() - start) / kBatch);
  }
  for (double* mean : {&row.contacts, &row.iterative, &row.lcp_failures}) *mean /= kBatches * kBatch;
  row.ns_per_step = median(times);
  return row;
}

std::string csv(const std::vector<ContactCostRow>& rows) {
  std::string out = "method,slabs,contacts,cpu_per_step[ns],share_quick_step,lcp_failures_per_step\n";
  for (const ContactCostRow& row : rows)
    out += fmt::format("{},{},{},{},{},{}\n", row.method, row.slabs, row.contacts, row.ns_per_step,
                       row.iterative, row.lcp_failures);
  return out;
}

Report report_of(const std::vector<ContactCostRow>& rows) {
  std::string data, curves;
  constexpr std::array kColours = {"#1b6ca8", "#c8553d", "#3a7d44", "#202020"};
  for (std::size_t w = 0; w < kMethods.size(); ++w) {
    data += fmt::format("$method{} << EOD\n", w);
    for (const ContactCostRow& row : rows)
      if (row.method == kMethods[w].name)
        data += fmt::format("{} {}\n", row.contacts, 1e-3 * row.ns_per_step);
    data += "EOD\n";
    curves += fmt::format("$method{0} with linespoints lw {1} dt {2} pt {3} lc rgb '{4}' title '{5}', ", w,
                          w == 3 ? 2.5 : 1.6, w == 3 ? 2 : 1, w == 3 ? 6 : 7, kColours[w], kMethods[w].name);
  }
  return {csv(rows),
          {},
          data,
          {{"contacts_cost", "noenhanced size 1000,640 font 'DejaVu Sans,11'",
            fmt::format("  set title 'A hand on a stack of slabs: cost of a step of 1 ms'\n"
                        "  set xlabel 'contact points in one island, with the 15 joints of a hand'\n"
                        "  set ylabel 'CPU time of a step [us]'\n"
                        "  set logscale y\n  set grid\n  set key left top\n"
                        "  plot {} 1000 with lines dt 3 lw 2 lc rgb '#606060' title 'real time'\n",
                        curves)}}};
}

}  // namespace

}  // namespace handsim::study

int main(int argc, char** argv) {
  using namespace handsim::study;
  if (argc != 2) return std::puts("contact_cost FOLDER"), 2;
  std::vector<ContactCostRow> rows;
  for (const MethodChoice& method : kMethods)
    for (const int slabs : kHeights) rows.push_back(measure(slabs, method));
  return write_report(argv[1], "contacts_cost", report_of(rows)) ? 0 : 1;
}
