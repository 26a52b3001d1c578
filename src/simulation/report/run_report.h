// The HTML page of finished runs, from the files in their folders: resolved.yaml is compiled again, and
// poses, contacts and curves are read from the tables. Nothing is simulated.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace handsim::simulation {

/// Text of the page. A second run is drawn over the first one as a ghost.
/// @param folders of one or two runs. @throws Error (input) for no run, other tables, a build without three.
std::string run_report(const std::vector<std::filesystem::path>& folders);

/// Name of the page in the folder of a run or study.
inline constexpr const char* kReportName = "report.html";

}  // namespace handsim::simulation
