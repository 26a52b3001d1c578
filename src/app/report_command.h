// Reports of runs and studies: one HTML page in their folder.
#pragma once

#include <filesystem>

#include "handsim/app/commands.h"
#include "handsim/scene/compile/scene.h"

namespace handsim::app {

/// Sets what the report of a run shows beside its poses: contacts, where an effect of contact is on.
void record_contacts(scene::Scene& scene);

/// Writes FOLDER/report.html of a run or study; returns its path.
/// @throws Error (input) for a folder of neither.
std::filesystem::path write_report(const std::filesystem::path& folder);

/// Opens a page in the browser of the desktop; false if there is none.
bool open_in_browser(const std::filesystem::path& page);

}  // namespace handsim::app
