#include "handsim/study/repeat/study_repeat.h"

#include <fmt/format.h>

#include "handsim/core/input_file.h"
#include "handsim/output/report/page.h"

namespace handsim::study {

StudyCommands grasp_commands(const GraspStudy& study) {
  StudyCommands out{"handsim grasp"};
  for (const std::filesystem::path& scene : study.scenes)
    out.study += " " + output::shell_word(scene.string());
  for (const std::filesystem::path& person : study.persons)
    out.study += " --persons " + output::shell_word(person.string());
  if (study.sides.size() == 2)
    out.study += " --side both";
  else if (!study.sides.empty())
    out.study += " --side " + study.sides.front();
  if (study.friction) out.study += fmt::format(" --friction {}", *study.friction);
  for (const std::string& set : study.overrides) out.study += " --set " + output::shell_word(set);
  out.study += " --out again";
  return out;
}

StudyCommands rollouts_commands(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                                std::optional<int> seed) {
  StudyCommands out{command_text("rollouts", file, overrides)};
  std::string row = command_text("run", file, overrides) + " --rollout {rollout}";
  for (std::string* text : {&out.study, &row})
    if (seed) *text += fmt::format(" --seed {}", *seed);
  out.templates["rollouts.csv"] = row;
  return out;
}

std::string shard_commands(const std::vector<std::filesystem::path>& folders) {
  constexpr std::size_t kMost = 1UL << 20U;
  for (const std::filesystem::path& folder : folders)
    if (std::filesystem::is_regular_file(folder / kStudyFile))
      return read_input_file(folder / kStudyFile, "the commands of a study", kMost);
  return {};
}

}  // namespace handsim::study
