// Commands for studies of many runs.
#include <memory>
#include <string>

#include <fmt/format.h>

#include "handsim/app/command_line.h"
#include "handsim/app/commands.h"

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

}  // namespace

void add_study_commands(CommandLine& line) { add_grasp(line); }

}  // namespace handsim::app
