// handsim with one more command: `handsim stability` becomes this program.
#include <memory>

#include "handsim/app/command_line.h"
#include "handsim/app/commands.h"
#include "handsim/app/console.h"
#include "handsim/app/progress.h"
#include "stability/stability.h"

namespace {

using namespace handsim;

struct Asked : study::StabilityOptions {
  study::StudyRun run;
};

int run(const Asked& asked) {
  return app::with_bar(asked.run, [&](const study::StudyRun& run) { return study::stability(asked, run); });
}

void add_stability(app::CommandLine& line) {
  const auto asked = std::make_shared<Asked>();
  CLI::App& stability = line.add(
      "stability",
      "Hard cases: every engine, method and step against an oracle, as table, CSV, JSON, plots and pictures",
      "handsim stability config/stability.yaml --out out/stability --quick", run, asked);
  app::add_input(stability, "study", asked->study, "study file")->required();
  app::add_out(stability, asked->run.out, "folder for the study's files");
  stability.add_option("--case", asked->cases, "run this case alone; may be repeated")
      ->allow_extra_args(false);
  stability.add_flag("--quick", asked->quick, "shorter runs of most cases, at most a minute in all");
  stability.add_flag("--report", asked->run.report, "report.html: tables to sort and a plot, for a browser");
  stability.add_flag_callback(
      "--no-pictures", [asked] { asked->pictures = false; }, "draw no scenes");
}

}  // namespace

int main(int argc, char** argv) {
  app::prepare_streams();
  return app::finish_output(app::run_command_line(argc, argv, add_stability));
}
