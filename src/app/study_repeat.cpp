#include "handsim/app/study_repeat.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/output/atomic_file.h"
#include "handsim/output/report/page.h"

namespace handsim::app {

namespace {

/// With the step after the other overrides.
std::string run_text(const std::filesystem::path& scene, std::vector<std::string> overrides, double step) {
  overrides.push_back(fmt::format("solver.step={}", step));
  return command_text("run", scene, overrides);
}

}  // namespace

std::string command_text(const char* word, const std::filesystem::path& file,
                         const std::vector<std::string>& overrides) {
  std::string out = fmt::format("handsim {} {}", word, output::shell_word(file.string()));
  for (const std::string& set : overrides) out += " --set " + output::shell_word(set);
  return out + " --out again";
}

study::StudyCommands accuracy_commands(const std::filesystem::path& file, const study::AccuracySpec& spec,
                                       const study::AccuracyResult& result) {
  study::StudyCommands out{command_text("accuracy", file)};
  for (const study::AccuracyRow& row : result.rows) {
    const auto method =
        std::find_if(spec.methods.begin(), spec.methods.end(),
                     [&](const study::AccuracyMethod& each) { return each.name == row.method; });
    // The programs of other engines have commands of their own.
    const bool own = method != spec.methods.end() && !method->peer;
    out.rows["accuracy.csv"].push_back(
        own ? run_text(method->scene.value_or(spec.scene), method->set, row.step) : "");
  }
  return out;
}

study::StudyCommands effects_commands(const std::filesystem::path& file,
                                      const std::vector<std::string>& overrides, const scene::Scene& scene,
                                      const study::EffectsResult& result) {
  study::StudyCommands out{command_text("effects", file, overrides)};
  std::vector<std::string>& rows = out.rows["effects.csv"];
  rows.push_back(command_text("run", file, overrides));
  for (const study::EffectRow& row : result.rows) {
    std::vector<std::string_view> left;
    bool is_effect = false;
    for (std::size_t i = 0; i < model::kEffectNames.size(); ++i) {
      const auto effect = static_cast<model::Effect>(i);
      const bool own = model::name(effect) == row.name;
      is_effect = is_effect || own;
      const bool removed = own || std::find(row.with.begin(), row.with.end(), effect) != row.with.end();
      if (scene.spec.solver.effects.has(effect) && !removed) left.push_back(model::name(effect));
    }
    std::vector<std::string> sets = overrides;
    sets.push_back(fmt::format("effects=[{}]", fmt::join(left, ", ")));
    rows.push_back(is_effect && !row.fault ? command_text("run", file, sets) : "");
  }
  return out;
}

study::StudyCommands stability_commands(const std::filesystem::path& file,
                                        const study::StabilityResult& result) {
  study::StudyCommands out{command_text("stability", file)};
  std::vector<std::string>& rows = out.rows["stability.csv"];
  for (const study::CaseResult& of : result.cases) {
    const std::vector<study::Variant> variants = study::variants(*of.of, result.quick);
    for (const study::StabilityRow& row : of.rows) {
      std::string text;
      for (const study::Variant& variant : variants)
        for (const study::Way& way : of.of->ways) {
          if (variant.name != row.variant || way.name != row.way || way.refused) continue;
          std::vector<std::string> sets = of.of->set;
          for (const auto* more : {result.quick ? &of.of->quick_set : nullptr, &way.set, &variant.set})
            if (more) sets.insert(sets.end(), more->begin(), more->end());
          text = run_text(variant.scene, sets, row.step);
        }
      rows.push_back(text);
    }
  }
  return out;
}

study::StudyCommands grasp_commands(const study::GraspStudy& study) {
  study::StudyCommands out{"handsim grasp"};
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

study::StudyCommands agreement_commands(const study::AgreementStudy& study,
                                        const study::AgreementTable& table) {
  const std::string scene = "handsim grasp " + output::shell_word(study.scene.string());
  const auto with = [](std::string text, const std::vector<std::string>& overrides) {
    for (const std::string& set : overrides) text += " --set " + output::shell_word(set);
    return text + " --out again";
  };
  std::string all = fmt::format("{} --agree {} --seed {}", scene, study.draws, study.seed);
  if (study.quarter_steps > 0) all += fmt::format(" --quarter-steps {}", study.quarter_steps);
  study::StudyCommands out{with(all, study.overrides)};
  for (const study::AgreementRow& row : table.rows) {
    if (!row.done()) continue;
    std::vector<std::string> sets = study::drawn_overrides(study, row);
    sets.emplace_back("solver.engine=articulated");
    out.rows["agreement.csv"].push_back(with(fmt::format("{} --friction {}", scene, row.friction), sets));
  }
  return out;
}

study::StudyCommands validate_commands(const std::filesystem::path& file, bool runs,
                                       const study::ValidateResult& result) {
  study::StudyCommands out{fmt::format("handsim validate {}{} --out again", output::shell_word(file.string()),
                                       runs ? " --runs" : "")};
  for (const study::ValidateRow& row : result.rows)
    if (row.measured)
      out.rows["validate.csv"].push_back(row.of->kind == study::Measured::simulation
                                             ? command_text("run", row.of->scene, row.of->changes)
                                             : "");
  return out;
}

study::StudyCommands rollouts_commands(const std::filesystem::path& file,
                                       const std::vector<std::string>& overrides, std::optional<int> seed) {
  study::StudyCommands out{command_text("rollouts", file, overrides)};
  std::string row = command_text("run", file, overrides) + " --rollout {rollout}";
  for (std::string* text : {&out.study, &row})
    if (seed) *text += fmt::format(" --seed {}", *seed);
  out.templates["rollouts.csv"] = row;
  return out;
}

void finish_study(const std::filesystem::path& out, const study::StudyCommands& commands, bool report) {
  study::write_commands(out, commands);
  if (report) output::write_file(out / study::kPageFile, study::study_page(out));
}

}  // namespace handsim::app
