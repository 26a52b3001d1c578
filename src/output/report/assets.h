// The files that the build puts into the program (cmake/embed.cmake).
#pragma once

#include <string_view>

namespace handsim::output::assets {

extern const std::string_view page_html, style_css, three, scene_js, curves_js, table_js, run_js, study_js;

}  // namespace handsim::output::assets
