#include "handsim/app/commands.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>

#include "handsim/app/command_line.h"
#include "handsim/core/input_file.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/child.h"
#include "handsim/output/output_folder.h"
#include "handsim/output/report/page.h"
#include "handsim/simulation/report/run_report.h"
#include "handsim/study/report.h"

namespace handsim::app {

namespace {

namespace fs = std::filesystem;

bool is_run(const fs::path& folder) { return has_entry(folder / "trajectory.csv"); }

/// The user's own folder for pages that are only looked at. Other users cannot write into it.
fs::path pages_folder() {
  const fs::path out = fs::temp_directory_path() / ("handsim-" + std::to_string(::getuid()));
  struct stat found {};
  const bool made = ::mkdir(out.c_str(), 0700) == 0 || errno == EEXIST;
  if (!made || ::lstat(out.c_str(), &found) != 0 || !S_ISDIR(found.st_mode) || found.st_uid != ::getuid() ||
      (found.st_mode & 022U) != 0)
    throw input_error(out.string(), "no folder that only you can write",
                      "to remove it, or another folder for temporary files (TMPDIR)");
  return out;
}

/// A new folder, which is removed with this object.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(const fs::path& parent) {
    std::string name = (parent / "run-XXXXXX").string();
    if (!::mkdtemp(name.data()))
      throw input_error(name, "no new folder", "a folder for temporary files (TMPDIR)");
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

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
  add_input(command, "scene", arguments->scene, "scene file")->required();
  add_overrides(command, arguments->overrides);
  command.add_flag("--no-browser", arguments->no_browser, "only print where the page is");
}

}  // namespace

void record_contacts(scene::Scene& scene) {
  if (!scene.spec.solver.effects.any_contact()) return;
  scene.spec.record_contacts = true;
  scene.spec.solver.contact_forces = true;
}

fs::path write_report(const std::vector<fs::path>& folders, const std::optional<fs::path>& out,
                      const std::optional<simulation::RunTitle>& title) {
  std::error_code ignored;
  for (const fs::path& folder : folders)
    if (!fs::is_directory(folder, ignored))
      throw input_error("report", folder.string(), "the folder of a run or study");
  if (folders.empty() || folders.size() > 2)
    throw input_error("report", folders.empty() ? "no folder" : "more than two folders",
                      "one run or study, or two runs to compare");
  if (folders.size() == 2)
    for (const fs::path& folder : folders)
      if (!is_run(folder)) throw input_error("report", folder.string() + ", no folder of a run", "two runs");
  const fs::path page = out.value_or(folders.front() / simulation::kReportName);
  if (ending_of(page) != ".html") throw input_error("--out", page.string(), "a name that ends in .html");
  output::check_target(out ? "--out" : "report", page, {"a page of handsim", output::page_mark()});
  output::write_file(page, is_run(folders.front()) ? simulation::run_report(folders, title)
                                                   : study::study_page(folders.front()));
  return page;
}

int report_command(const ReportArguments& arguments) {
  print("{}\n", write_report(arguments.folders, arguments.out).string());
  return 0;
}

int view_command(const ViewArguments& arguments) {
  output::require_three();
  const fs::path pages = pages_folder();
  const TemporaryFolder folder(pages);
  RunArguments run;
  run.scene = arguments.scene;
  run.overrides = arguments.overrides;
  run.out = folder.path();
  run.report = true;
  run.passing = {arguments.scene.string(),
                 study::command_text({"run", arguments.scene.string()}, arguments.overrides)};
  const int status = run_scene_command(run);
  if (!fs::exists(run.out / simulation::kReportName)) return status;
  // The browser may read the page after this program has ended.
  const fs::path page = pages / (arguments.scene.stem().string() + ".html");
  std::error_code failure;
  fs::rename(run.out / simulation::kReportName, page, failure);
  if (failure) throw output_error(page.string(), failure.message(), "a report of the run");
  const bool screen = std::getenv("DISPLAY") || std::getenv("WAYLAND_DISPLAY");
  if (arguments.no_browser || !screen ||
      output::wait_for(output::start_program({"xdg-open", fs::absolute(page).string()})) != 0)
    print("open it in a browser: {}\n", page.string());
  return status;
}

void add_report_commands(CommandLine& line) {
  add_report(line);
  add_view(line);
}

}  // namespace handsim::app
