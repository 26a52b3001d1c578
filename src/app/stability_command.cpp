#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/app/progress.h"
#include "handsim/output/atomic_file.h"
#include "handsim/study/stability_report.h"

namespace handsim::app {

int stability_command(const StabilityArguments& arguments) {
  const study::StabilitySpec spec = study::load_stability(arguments.study);
  study::StabilityOptions options;
  options.cases = arguments.cases;
  options.quick = arguments.quick;
  study::StabilityResult result;
  {
    ProgressBar bar;
    options.progress = [&bar](double share) { bar.show(share); };
    result = study::run_stability(spec, options);
  }
  fmt::print("{}\n{}", spec.title, study::stability_table(result));
  const bool plotted = study::write_stability(spec, result, arguments.out);
  if (!arguments.no_pictures) study::draw_stability(result, arguments.out);
  fmt::print("files in {}{}\n", arguments.out.string(),
             plotted ? "" : " (no plots: gnuplot is missing or failed; stability.gp is its script)");
  return result.passed() ? 0 : 1;
}

}  // namespace handsim::app
