// Reports of runs and studies: one HTML page in their folder.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "handsim/app/commands.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::app {

/// Sets what the report of a run shows beside its poses: contacts, where an effect of contact is on.
void record_contacts(scene::Scene& scene);

/// Writes the page of a run or study, or of two runs in comparison; returns its path. @param out absent:
/// report.html in the first folder. @throws Error (input) for other folders, and for more than two
std::filesystem::path write_report(const std::vector<std::filesystem::path>& folders,
                                   const std::optional<std::filesystem::path>& out = {});

}  // namespace handsim::app
