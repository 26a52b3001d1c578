// The commands that repeat a study of grasps or rollouts and the runs of its rows, for study.json and its
// page.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "handsim/study/grasp/grasp_study.h"
#include "handsim/study/study_page.h"

namespace handsim::study {

StudyCommands grasp_commands(const GraspStudy& study);
/// @param seed in place of the study's.
StudyCommands rollouts_commands(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                                std::optional<int> seed);
/// Text of the study.json that the shards of a study have left; empty where there is none.
std::string shard_commands(const std::vector<std::filesystem::path>& folders);

}  // namespace handsim::study
