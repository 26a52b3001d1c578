// The HTML page of finished runs, from their files: resolved.yaml is compiled again, nothing is simulated.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace handsim::simulation {

/// What a page calls its run, and the command that repeats it, where its folder does not last.
struct RunTitle {
  std::string name, command;
};

/// Text of the page. A second run is drawn over the first one as a ghost.
/// @param folders of one or two runs. @param title absent: of the first folder. @throws Error (input) for no
/// run, other tables, a build without three.
std::string run_report(const std::vector<std::filesystem::path>& folders,
                       const std::optional<RunTitle>& title = {});

/// Name of the page in the folder of a run or study.
inline constexpr const char* kReportName = "report.html";

}  // namespace handsim::simulation
