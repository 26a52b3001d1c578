#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/app/console.h"
#include "handsim/app/progress.h"
#include "handsim/app/study_repeat.h"
#include "handsim/output/output_folder.h"
#include "handsim/study/effects/effects.h"

namespace handsim::app {

int effects_command(const EffectsArguments& arguments) {
  const scene::Scene scene = scene::load_scene(arguments.scene, arguments.overrides);
  print_warnings(scene.warnings);
  const output::OutputFolder folder(arguments.out, study::effects_files(),
                                    [&] { return scene::files_read(scene); });
  study::EffectsResult result;
  {
    ProgressBar bar;
    result = study::run_effects(scene, arguments.repeats, [&bar](double share) { bar.show(share); });
  }
  folder.clear();
  const PlotNote note = plot_note(study::write_effects(scene, result, arguments.out));
  finish_study(arguments.out, effects_commands(arguments.scene, arguments.overrides, scene, result),
               arguments.report);
  if (arguments.json) {
    print_text(study::effects_json(scene, result));
    if (note.status != 0) print_error("missing: plots{}\n", note.text);
    return note.status;
  }
  print(
      "{}\nWithout each effect in turn: CPU time of a step, and change of the motion over {:g} s. Median of "
      "{} "
      "rounds; +-: half their interquartile range.\n\n{}\nfiles in {}{}\n",
      scene.spec.title, scene.spec.duration, result.repeats, study::effects_table(result),
      arguments.out.string(), note.text);
  return note.status;
}

}  // namespace handsim::app
