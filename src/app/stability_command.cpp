#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/app/console.h"
#include "handsim/app/progress.h"
#include "handsim/app/study_repeat.h"
#include "handsim/output/output_folder.h"
#include "handsim/study/stability/stability.h"

namespace handsim::app {

int stability_command(const StabilityArguments& arguments) {
  const study::StabilitySpec spec = study::load_stability(arguments.study);
  const output::OutputFolder folder(arguments.out, study::stability_files(spec), [&] {
    std::vector<std::filesystem::path> out = {arguments.study};
    for (const study::StabilityCase& of : spec.cases)
      out.insert(out.end(), of.scenes.begin(), of.scenes.end());
    return out;
  });
  study::StabilityOptions options;
  options.cases = arguments.cases;
  options.quick = arguments.quick;
  study::StabilityResult result;
  {
    ProgressBar bar;
    options.progress = [&bar](double share) { bar.show(share); };
    result = study::run_stability(spec, options);
  }
  print("{}\n{}", spec.title, study::stability_table(result));
  folder.clear();
  const PlotNote note = plot_note(study::write_stability(spec, result, arguments.out));
  finish_study(arguments.out, stability_commands(arguments.study, result), arguments.report);
  std::optional<std::string> failure;
  if (!arguments.no_pictures) failure = study::draw_stability(result, arguments.out);
  if (failure) print_error("missing: pictures: {}\n", *failure);
  print("files in {}{}\n", arguments.out.string(), note.text);
  return result.passed() && !failure ? note.status : 1;
}

}  // namespace handsim::app
