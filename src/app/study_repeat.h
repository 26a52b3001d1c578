// The commands that repeat a study and the runs of its rows, for study.json and its page.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "handsim/study/accuracy/accuracy.h"
#include "handsim/study/effects/effects.h"
#include "handsim/study/grasp/agreement.h"
#include "handsim/study/grasp/grasp_study.h"
#include "handsim/study/stability/stability.h"
#include "handsim/study/study_page.h"
#include "handsim/study/validate/validate.h"

namespace handsim::app {

/// `handsim WORD FILE --set ...`.
std::string command_text(const char* word, const std::filesystem::path& file,
                         const std::vector<std::string>& overrides = {});

study::StudyCommands accuracy_commands(const std::filesystem::path& file, const study::AccuracySpec& spec,
                                       const study::AccuracyResult& result);
study::StudyCommands effects_commands(const std::filesystem::path& file,
                                      const std::vector<std::string>& overrides, const scene::Scene& scene,
                                      const study::EffectsResult& result);
study::StudyCommands stability_commands(const std::filesystem::path& file,
                                        const study::StabilityResult& result);

study::StudyCommands grasp_commands(const study::GraspStudy& study);
/// A row's command runs its grasp on the articulated engine.
study::StudyCommands agreement_commands(const study::AgreementStudy& study,
                                        const study::AgreementTable& table);
/// Rows that are simulations have commands.
study::StudyCommands validate_commands(const std::filesystem::path& file, bool runs,
                                       const study::ValidateResult& result);
/// @param seed in place of the study's.
study::StudyCommands rollouts_commands(const std::filesystem::path& file,
                                       const std::vector<std::string>& overrides, std::optional<int> seed);

/// Writes study.json, and report.html if wanted.
void finish_study(const std::filesystem::path& out, const study::StudyCommands& commands, bool report);

}  // namespace handsim::app
