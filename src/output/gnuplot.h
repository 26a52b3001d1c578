// Starts gnuplot, which draws the plots of runs and studies.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace handsim::output {

/// Runs gnuplot in a folder, without a shell; its exit status, -1 where it cannot be started.
int gnuplot(std::vector<std::string> arguments, const std::filesystem::path& folder);

}  // namespace handsim::output
