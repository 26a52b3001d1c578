// Starts gnuplot, which draws the plots of runs and studies.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace handsim::output {

/// Runs gnuplot in a folder, without a shell; its exit status, -1 where it cannot be started.
int gnuplot(std::vector<std::string> arguments, const std::filesystem::path& folder);
bool has_gnuplot();

/// Runs a gnuplot script that stands in a folder and names the files it makes by place('NAME.png') or
/// place('NAME.svg'), which `kPlotHead` defines. They appear under their names only when all are whole,
/// as those of AtomicFile; a script run by hand writes them at once.
/// @return false where gnuplot is missing or fails, or one is not whole, as on a full disk.
bool plot(const std::string& script, const std::filesystem::path& folder,
          const std::vector<std::string>& outputs);
inline constexpr const char* kPlotHead = "place(name) = exists('part') ? part.name : name\n";

/// Text that can stand between single quotes in a script: no quotes, backslashes or control characters,
/// which would end it and begin a command.
std::string plot_text(std::string text);

}  // namespace handsim::output
