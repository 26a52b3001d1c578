// Commands for studies of many runs.
#include <memory>
#include <string>

#include <fmt/format.h>

#include "handsim/app/command_line.h"
#include "handsim/app/commands.h"
#include "handsim/app/progress.h"
#include "handsim/study/validate/validate.h"

namespace handsim::app {

namespace {

void add_grasp(CommandLine& line) {
  const auto arguments = std::make_shared<GraspArguments>();
  CLI::App& grasp = line.add("grasp",
                             "Run grasp and climb scenes: table of what was held, how firmly, the least "
                             "friction that holds, and the load that a hand carried on a hold",
                             "handsim grasp config --out out/grasps --side both", grasp_command, arguments);
  arguments->page = line.page;
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

struct ValidateArguments : study::ValidateOptions {
  study::StudyRun run;
};

int validate_command(const ValidateArguments& arguments) {
  return with_bar(arguments.run, [&](const study::StudyRun& run) { return study::validate(arguments, run); });
}

void add_validate(CommandLine& line) {
  const auto asked = std::make_shared<ValidateArguments>();
  CLI::App& validate = line.add(
      "validate", "The hand against measurements: moment arms, forces, moments, masses beside their sources",
      "handsim validate --out out/validate", validate_command, asked);
  add_input(validate, "measurements", asked->file, "file of measurements (default: the installed ones)");
  validate
      .add_option("--out", asked->run.out,
                  "folder for the study's files and runs/ (default with --runs or --report: out/validate)")
      ->check(check_path);
  validate.add_flag("--runs", asked->runs, "also run the rows that are simulations (minutes)");
  add_uncertain(validate, asked->uncertain);
  add_report_flag(validate, asked->run);
  validate.parse_complete_callback([asked, &validate] {
    if (asked->run.out.empty() && (asked->runs || asked->run.report)) asked->run.out = default_out(validate);
  });
}

}  // namespace

void add_study_commands(CommandLine& line) {
  for (const auto add : {add_grasp, add_validate}) add(line);
}

}  // namespace handsim::app
