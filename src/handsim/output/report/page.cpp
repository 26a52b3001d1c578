#include "handsim/output/report/page.h"

#include <map>

#include "handsim/core/error.h"

namespace handsim::output {

/// The files that the build puts into the program (cmake/embed.cmake).
namespace assets {
extern const std::string_view page_html, style_css, three, skin_js, scene_js, curves_js, table_js, run_js,
    study_js;
}

namespace {

std::string replaced(std::string_view text, char from, std::string_view to) {
  std::string out;
  out.reserve(text.size());
  for (const char c : text)
    if (c == from)
      out += to;
    else
      out += c;
  return out;
}

std::string html_text(std::string_view text) { return replaced(replaced(text, '&', "&amp;"), '<', "&lt;"); }

std::string script(std::string_view text) { return "<script>" + std::string(text) + "</script>\n"; }

}  // namespace

bool has_three() { return !assets::three.empty(); }

void require_three() {
  if (!has_three())
    throw input_error("report", "a build without three.js",
                      "one with it: install libjs-three and build again");
}

std::string shell_word(const std::string& text) {
  if (!text.empty() &&
      text.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./=:,+%@") ==
          std::string::npos)
    return text;
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

std::string_view page_mark() { return assets::page_html.substr(0, assets::page_html.find("{{")); }

std::string report_page(PageKind kind, std::string_view title, std::string_view json) {
  if (kind == PageKind::run) require_three();
  std::string scripts;
  if (kind == PageKind::run)
    for (const std::string_view text : {assets::three, assets::skin_js, assets::scene_js})
      scripts += script(text);
  for (const std::string_view text : {assets::curves_js, assets::table_js}) scripts += script(text);
  scripts += script(kind == PageKind::run ? assets::run_js : assets::study_js);
  const std::map<std::string_view, std::string> parts = {{"title", html_text(title)},
                                                         {"style", std::string(assets::style_css)},
                                                         // In JSON a < is within a string.
                                                         {"data", replaced(json, '<', "\\u003c")},
                                                         {"scripts", scripts}};
  std::string out;
  std::string_view rest = assets::page_html;
  for (std::size_t at; (at = rest.find("{{")) != std::string_view::npos;) {
    const std::size_t end = rest.find("}}", at);
    out += rest.substr(0, at);
    out += parts.at(rest.substr(at + 2, end - at - 2));
    rest.remove_prefix(end + 2);
  }
  return out += rest;
}

}  // namespace handsim::output
