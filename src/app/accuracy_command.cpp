#include <algorithm>

#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/app/console.h"
#include "handsim/app/progress.h"
#include "handsim/app/study_repeat.h"
#include "handsim/core/input_file.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/output_folder.h"
#include "handsim/study/accuracy/accuracy.h"

namespace handsim::app {

namespace {

/// The tables of costs in a file, which may be missing.
std::vector<scene::CostTable> costs_in(const std::filesystem::path& path) {
  if (!has_entry(path)) return {};
  YamlNode root = load_yaml(path);
  Diagnostics diagnostics;
  std::vector<scene::CostTable> tables = scene::read_costs(root, "", diagnostics);
  diagnostics.throw_if_any();
  return tables;
}

/// Replaces or adds the study's part of a table of costs.
void update_costs(const std::filesystem::path& path, const study::AccuracySpec& spec,
                  const study::AccuracyResult& result) {
  scene::CostTable table = study::cost_table(spec, result);
  std::vector<scene::CostTable> tables = costs_in(path);
  std::erase_if(tables, [&](const scene::CostTable& each) { return each.kind == table.kind; });
  tables.push_back(std::move(table));
  std::sort(tables.begin(), tables.end(),
            [](const scene::CostTable& a, const scene::CostTable& b) { return a.kind < b.kind; });
  output::write_file(path,
                     "# Costs of accuracy by kind of scene: RMS error of the rates over their RMS, and CPU "
                     "seconds per simulated second\n"
                     "# of the scene measured. Engine auto uses this table. Each part is the result of its "
                     "study:\n"
                     "# handsim accuracy STUDY --out DIR --no-peers --costs accuracy_costs.yaml, with "
                     "accuracy_two_hands.yaml,\n"
                     "# accuracy_slider_crank.yaml, accuracy_stops.yaml and accuracy_contact.yaml.\n" +
                         emit_yaml(scene::write_costs(tables)));
}

}  // namespace

int accuracy_command(const AccuracyArguments& arguments) {
  study::AccuracySpec spec = study::load_accuracy(arguments.study);
  if (!arguments.no_peers) spec.peers = arguments.peers.value_or(HANDSIM_BUILT_PEERS);
  const output::OutputFolder folder(arguments.out, study::accuracy_files(), [&] {
    std::vector<std::filesystem::path> out = {arguments.study, spec.scene};
    for (const study::AccuracyMethod& method : spec.methods)
      if (method.scene) out.push_back(*method.scene);
    if (arguments.costs) out.push_back(*arguments.costs);
    return out;
  });
  if (arguments.costs) {
    const output::AtomicFile probe(*arguments.costs);
    // A file of another content is refused before the study.
    costs_in(*arguments.costs);
  }
  study::AccuracyResult result;
  {
    ProgressBar bar;
    result = study::run_accuracy(spec, [&bar](double share) { bar.show(share); });
  }
  print(
      "{}\nRMS rate error [{}/s] over the whole run and up to {:g} s; the error over the whole run saturates "
      "once the motions are out of phase.\n\n{}",
      spec.title, result.unit, spec.early, study::accuracy_table(result, spec.early));
  if (result.reference) print("\n{}", study::cheapest_table(result));
  for (const std::string& text : result.left_out) print("left out: {}\n", text);
  folder.clear();
  const PlotNote note = plot_note(study::write_accuracy(spec, result, arguments.out));
  finish_study(arguments.out, accuracy_commands(arguments.study, spec, result), arguments.report);
  print("\nfiles in {}{}\n", arguments.out.string(), note.text);
  if (arguments.costs) update_costs(*arguments.costs, spec, result);
  if (!arguments.target) return note.status;
  const study::AccuracyRow* row = study::cheapest(result, *arguments.target);
  if (!row) {
    print("no row reaches an error of {:g} {}/s\n", *arguments.target, result.unit);
    return 1;
  }
  print("cheapest at {:g} {}/s: {} at {:g} ms, error {:.3g}, {:.3g} CPU seconds per simulated second\n",
        *arguments.target, result.unit, row->method, 1e3 * row->step, row->rate_error, row->cpu_per_second);
  return note.status;
}

}  // namespace handsim::app
