// Commands for studies of many runs.
#include <limits>
#include <memory>
#include <string>

#include <fmt/format.h>

#include "handsim/app/command_line.h"
#include "handsim/app/commands.h"
#include "handsim/app/progress.h"
#include "handsim/study/accuracy/accuracy.h"
#include "handsim/study/effects/effects.h"

namespace handsim::app {

namespace {

void add_grasp(CommandLine& line) {
  const auto arguments = std::make_shared<GraspArguments>();
  CLI::App& grasp = line.add("grasp",
                             "Run grasp and climb scenes: table of what was held, how firmly, the least "
                             "friction that holds, and the load that a hand carried on a hold",
                             "handsim grasp config --out out/grasps --side both", grasp_command, arguments);
  add_input(grasp, "scenes", arguments->scenes, "scene files, or folders of them")->required();
  add_out(grasp, arguments->out, "folder for the runs' files, grasps.csv and climbs.csv, and both as .json");
  add_words(grasp.add_option("--side", arguments->side, "hand that grasps (default: the scene's)"), kSides);
  add_input(grasp, "--persons", arguments->persons,
            "person files, or folders of them, in place of the scenes'", "config/persons");
  add_overrides(grasp, arguments->overrides);
  grasp.add_option("--friction", arguments->friction, "of every surface, in place of the scenes'")
      ->check(number_from(0, 10, false, "a coefficient of friction, 0 to 10"));
  grasp.add_flag("--friction-search", arguments->friction_search,
                 "also find the smallest friction that still holds (seven more runs per scene)");
  grasp.add_flag(
      "--margin", arguments->margin,
      "run each grasp again with 5 % more and less friction and mass: marginal if that changes the verdict");
  grasp.add_flag("--confirm", arguments->confirm,
                 "run each grasp again at half the step: uncertain if that changes the verdict, or by more "
                 "than its margin");
  add_uncertain_runs(grasp, *arguments);
  add_report_flag(grasp, *arguments);
  grasp.add_flag("--pictures", arguments->pictures, "a picture at every phase");
  add_drawing(grasp, arguments->video, arguments->gl, "in each run's folder: a name without one");
}

template <class Options>
struct Asked : Options {
  study::StudyRun run;
  bool json = false;
};

/// The command of a study with a progress bar.
template <auto kStudy, class Options>
int bar_command(const Asked<Options>& asked) {
  return with_bar(asked.run, [&](const study::StudyRun& run) { return kStudy(asked, run); });
}

void add_accuracy(CommandLine& line) {
  const auto asked = std::make_shared<Asked<study::AccuracyOptions>>();
  CLI::App& accuracy =
      line.add("accuracy", "Errors and CPU times of methods and steps, as table, CSV, JSON and plots",
               "handsim accuracy config/accuracy_slider_crank.yaml --out out/accuracy --target 1e-3",
               bar_command<study::accuracy, study::AccuracyOptions>, asked);
  add_input(accuracy, "study", asked->study, "study file")->required();
  add_out(accuracy, asked->run.out, "folder for the study's files");
  accuracy
      .add_option("--target", asked->target,
                  "name the cheapest method and step that reaches this error; exit 1 if none does")
      ->check(number_from(std::numeric_limits<double>::min(), std::numeric_limits<double>::max(), false,
                          "an error above 0, such as 1e-3"));
  add_report_flag(accuracy, asked->run);
}

int effects_command(const Asked<study::EffectsOptions>& asked) {
  const scene::Scene scene = scene::load_scene(*asked.file, asked.overrides);
  print_warnings(scene.warnings);
  return with_bar(
      asked.run, [&](const study::StudyRun& run) { return study::effects(scene, asked, run); }, asked.json);
}

void add_effects(CommandLine& line) {
  const auto asked = std::make_shared<Asked<study::EffectsOptions>>();
  CLI::App& effects = line.add(
      "effects",
      "CPU time and influence of each effect of a scene: table, CSV, JSON and a plot of the scene without "
      "each effect in turn",
      "handsim effects config/dropped_hand.yaml --out out/effects --set duration=\"1 s\"", effects_command,
      asked);
  add_input(effects, "scene", asked->file, "scene file")->required();
  add_out(effects, asked->run.out, "folder for the study's files");
  add_overrides(effects, asked->overrides);
  effects.add_option("--repeats", asked->repeats, "timed rounds, for the median (default 7)")
      ->check(number_from(1, 1000, true, "a whole number of timed rounds, 1 to 1000"));
  add_report_flag(effects, asked->run);
  effects.add_flag("--json", asked->json, "print effects.json in place of the table");
}

}  // namespace

void add_study_commands(CommandLine& line) {
  for (const auto add : {add_grasp, add_accuracy, add_effects}) add(line);
}

}  // namespace handsim::app
