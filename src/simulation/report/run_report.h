// The HTML page of finished runs, from their files: resolved.yaml is compiled again, nothing is simulated.
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
