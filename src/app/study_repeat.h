// The commands that repeat a study and the runs of its rows, for study.json and its page.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "handsim/study/accuracy/accuracy.h"
#include "handsim/study/effects/effects.h"
#include "handsim/study/grasp/grasp_study.h"
#include "handsim/study/stability/stability.h"
#include "handsim/study/study_page.h"

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
/// @param seed in place of the study's.
study::StudyCommands rollouts_commands(const std::filesystem::path& file,
                                       const std::vector<std::string>& overrides, std::optional<int> seed);

/// Writes study.json, and report.html if wanted.
void finish_study(const std::filesystem::path& out, const study::StudyCommands& commands, bool report);

}  // namespace handsim::app
