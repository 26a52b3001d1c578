// One HTML page from a JSON text, with template, style and scripts (the files beside this one, and Debian's
// three.js) in the program: it opens from the disk and asks no network.
#pragma once

#include <string>
#include <string_view>

namespace handsim::output {

enum class PageKind {
  run,    ///< 3D view, curves and verdicts; needs three.js
  study,  ///< table and plot
};

/// True if the build found three.js.
bool has_three();
/// @throws Error (input) in a build without three.js.
void require_three();

/// A word of a shell's command, in single quotes where it needs them.
std::string shell_word(const std::string& text);

/// The first bytes of every page, by which files of handsim's are known.
std::string_view page_mark();

/// The text of the page. @param json text of an object; its strings cannot end the script that has them.
/// @throws Error (input) for a run in a build without three.js.
std::string report_page(PageKind kind, std::string_view title, std::string_view json);

}  // namespace handsim::output
