// Starts gnuplot, which draws the plots of runs and studies.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace handsim::output {

/// Runs gnuplot in a folder, without a shell; its exit status, -1 where it cannot be started.
int gnuplot(std::vector<std::string> arguments, const std::filesystem::path& folder);

/// Runs a gnuplot script that stands in a folder and names the files it makes by place('NAME'), which `head`
/// defines. They appear under their names only when all are complete, as those of AtomicFile; a script run by
/// hand writes them at once. @return false where gnuplot fails or one is missing.
bool plot(const std::string& script, const std::filesystem::path& folder,
          const std::vector<std::string>& outputs);
inline constexpr const char* kPlotHead = "place(name) = exists('parts') ? '.'.name.'.part' : name\n";

/// Text that can stand between single quotes in a script: no quotes, no control characters, which would end
/// the line and begin a command.
std::string plot_text(std::string text);

}  // namespace handsim::output
