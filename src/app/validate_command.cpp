#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/app/console.h"
#include "handsim/app/study_repeat.h"
#include "handsim/core/data_folder.h"
#include "handsim/output/output_folder.h"
#include "handsim/study/validate/validate.h"

namespace handsim::app {

int validate_command(const ValidateArguments& arguments) {
  const std::filesystem::path file =
      arguments.file ? *arguments.file : data_folder() / "config/validate.yaml";
  const study::ValidateSpec spec = study::load_validate(file);
  std::optional<output::OutputFolder> folder;
  if (arguments.out)
    folder.emplace(*arguments.out, study::validate_files(),
                   [&] { return std::vector<std::filesystem::path>{file}; });
  const study::ValidateResult result =
      study::run_validate(spec, arguments.runs ? std::optional(*arguments.out / "runs") : std::nullopt);
  print("{}\n\n{}", spec.title, study::validate_table(spec, result));
  if (folder) {
    folder->clear();
    const PlotNote note = plot_note(study::write_validate(spec, result, *arguments.out));
    finish_study(*arguments.out, validate_commands(file, arguments.runs, result), arguments.report);
    print("files in {}{}\n", arguments.out->string(), note.text);
    if (note.status != 0) return note.status;
  }
  return result.passed() ? 0 : 1;
}

}  // namespace handsim::app
