// Starts gnuplot, which draws the plots of runs and studies.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace handsim::output {

bool has_gnuplot();

/// Runs a gnuplot script of a folder. The script names its output files by place('NAME.png') or
/// place('NAME.svg'), which `kPlotHead` defines. The files get their names only when all of them are
/// complete, as with AtomicFile; a script that the user runs writes them directly.
/// @return false if gnuplot is missing or fails, or if a file is incomplete, for example on a full disk.
bool plot(const std::string& script, const std::filesystem::path& folder,
          const std::vector<std::string>& outputs);
inline constexpr const char* kPlotHead = "place(name) = exists('part') ? part.name : name\n";

/// Text for single quotes in a script: quotes, backslashes and controls, which could end it, are blanks.
std::string plot_text(std::string text);

/// A panel of a plot by parts of a hand.
struct Panel {
  const char* part;      ///< wrist, thumb, index, middle, ring or little
  std::string commands;  ///< `plot ...` with a curve for each name
};

/// Panels of the parts with which the names begin, such as `index_mcp.flexion`.
/// @param curve what `plot` draws of the name with this index, in a colour
std::vector<Panel> hand_panels(
    const std::vector<std::string>& names,
    const std::function<std::string(std::size_t index, const char* colour)>& curve);

}  // namespace handsim::output
