#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/app/progress.h"
#include "handsim/output/atomic_file.h"
#include "handsim/study/effects_report.h"

namespace handsim::app {

int effects_command(const EffectsArguments& arguments) {
  const scene::Scene scene = scene::load_scene(arguments.scene, arguments.overrides);
  for (const std::string& warning : scene.warnings) fmt::print(stderr, "warning: {}\n", warning);
  study::EffectsResult result;
  {
    ProgressBar bar;
    result = study::run_effects(scene, arguments.repeats, [&bar](double share) { bar.show(share); });
  }
  const bool plotted = study::write_effects(scene, result, arguments.out);
  if (arguments.json) {
    fmt::print("{}", study::effects_json(scene, result));
    return 0;
  }
  fmt::print(
      "{}\nEach effect taken away in turn: CPU time of a step, and what moves otherwise over {:g} s. Median "
      "of "
      "{} rounds; +-: half the range of their middle half.\n\n{}\nfiles in {}{}\n",
      scene.spec.title, scene.spec.duration, result.repeats, study::effects_table(result),
      arguments.out.string(),
      plotted ? "" : " (no plot: gnuplot is missing or failed; effects.gp is its script)");
  return 0;
}

}  // namespace handsim::app
