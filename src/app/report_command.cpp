#include "handsim/app/report_command.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>

#include "handsim/app/command_line.h"
#include "handsim/app/console.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/report/page.h"
#include "handsim/simulation/report/run_report.h"
#include "handsim/study/study_page.h"

namespace handsim::app {

namespace {

namespace fs = std::filesystem;

bool is_run(const fs::path& folder) { return fs::exists(folder / "trajectory.csv"); }

/// A new folder for a run that is only looked at.
fs::path temporary_folder() {
  std::string name = (fs::temp_directory_path() / "handsim-XXXXXX").string();
  if (!::mkdtemp(name.data()))
    throw input_error(name, "no new folder", "a folder for temporary files (TMPDIR)");
  return name;
}

}  // namespace

void record_contacts(scene::Scene& scene) {
  if (!scene.spec.solver.effects.any_contact()) return;
  scene.spec.record_contacts = true;
  scene.spec.solver.contact_forces = true;
}

fs::path write_report(const fs::path& folder) {
  const fs::path page = folder / simulation::kReportName;
  output::write_file(page, simulation::run_report({folder}));
  return page;
}

bool open_in_browser(const fs::path& page) {
  if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY")) return false;
  std::string program = "xdg-open", path = fs::absolute(page).string();
  const std::array<char*, 3> arguments = {program.data(), path.data(), nullptr};
  pid_t child = 0;
  if (::posix_spawnp(&child, program.c_str(), nullptr, nullptr, arguments.data(), environ) != 0) return false;
  int status = 0;
  return ::waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

int report_command(const ReportArguments& arguments) {
  for (const fs::path& folder : arguments.folders)
    if (!fs::is_directory(folder))
      throw input_error("report", folder.string(), "the folder of a run or study");
  if (arguments.folders.size() > 2)
    throw input_error("report", "more than two folders", "one run or study, or two runs to compare");
  if (arguments.folders.size() == 2)
    for (const fs::path& folder : arguments.folders)
      if (!is_run(folder)) throw input_error("report", folder.string() + ", no folder of a run", "two runs");
  const fs::path page = arguments.out.value_or(arguments.folders.front() / simulation::kReportName);
  const bool run = is_run(arguments.folders.front());
  output::write_file(
      page, run ? simulation::run_report(arguments.folders) : study::study_page(arguments.folders.front()));
  print("{}\n", page.string());
  return 0;
}

int view_command(const ViewArguments& arguments) {
  output::require_three();
  RunArguments run;
  run.scene = arguments.scene;
  run.overrides = arguments.overrides;
  run.out = temporary_folder();
  run.report = true;
  const int status = run_scene_command(run);
  const fs::path page = run.out / simulation::kReportName;
  if (fs::exists(page) && (arguments.no_browser || !open_in_browser(page)))
    print("open it in a browser: {}\n", page.string());
  return status;
}

namespace {

void add_report(CommandLine& line) {
  const auto arguments = std::make_shared<ReportArguments>();
  CLI::App& command =
      line.add("report", "One HTML page of a finished run or study, or of two runs in comparison",
               "handsim report out/two_hands", report_command, arguments);
  command
      .add_option("folders", arguments->folders, "folder of a run or study; two runs: the second as a ghost")
      ->required();
  command.add_option("--out", arguments->out, "page to write (default: report.html in the first folder)")
      ->check(check_path);
}

void add_view(CommandLine& line) {
  const auto arguments = std::make_shared<ViewArguments>();
  CLI::App& command =
      line.add("view", "Simulate a scene in a temporary folder and show its report in the browser",
               "handsim view config/two_hands.yaml", view_command, arguments);
  command.add_option("scene", arguments->scene, "scene file")->required();
  add_overrides(command, arguments->overrides);
  command.add_flag("--no-browser", arguments->no_browser, "only print where the page is");
}

}  // namespace

void add_report_commands(CommandLine& line) {
  add_report(line);
  add_view(line);
}

}  // namespace handsim::app
