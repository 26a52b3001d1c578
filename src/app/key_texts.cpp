#include "handsim/app/key_texts.h"

#include <map>
#include <regex>
#include <vector>

#include "handsim/core/text.h"

namespace handsim::app {

namespace assets {
extern const std::string_view control_md, keys_md, motion_md, persons_md, rollouts_md, scenes_md;
}  // namespace assets

namespace {

using Texts = std::map<std::string, std::string, std::less<>>;

std::vector<std::string_view> split(std::string_view text, std::string_view at) {
  std::vector<std::string_view> out;
  for (std::size_t end = text.find(at); end != std::string_view::npos; end = text.find(at)) {
    out.push_back(text.substr(0, end));
    text.remove_prefix(end + at.size());
  }
  out.push_back(text);
  return out;
}

/// Markdown as plain text.
std::string plain(std::string_view cell) {
  static const std::regex link(R"(\[([^\]]*)\]\([^)]*\))"), mark("`|^ +| +$");
  const std::string linked(cell);
  return std::regex_replace(std::regex_replace(linked, link, "$1"), mark, "");
}

/// Adds the rows of the table at the start of `text`. @param blocks `scene objects`
void add_table(std::string_view text, const std::vector<std::string_view>& blocks, Texts& out) {
  while (text.starts_with('|')) {
    const std::vector<std::string_view> cells = split(take_line(text), " |");
    if (cells.size() < 3) continue;
    // Between backticks: every second part.
    const std::vector<std::string_view> parts = split(cells.front(), "`");
    for (std::size_t i = 1; i < parts.size(); i += 2) {
      // `axes[].range`, `choice: [a, b]`
      std::string key(parts[i].substr(0, parts[i].find(':')));
      if (const std::size_t list = key.find("[]"); list != std::string::npos) key.erase(list, 2);
      for (const std::string_view block : blocks)
        out.emplace(std::string(block) + (block.find(' ') == std::string_view::npos ? " " : ".") + key,
                    plain(cells[cells.size() - 2]));
    }
  }
}

Texts read_pages() {
  constexpr std::string_view kMark = "<!-- keys: ";
  Texts out;
  for (std::string_view page : {assets::scenes_md, assets::persons_md, assets::control_md,
                                assets::rollouts_md, assets::motion_md, assets::keys_md})
    for (std::size_t at = page.find(kMark); at != std::string_view::npos; at = page.find(kMark)) {
      page.remove_prefix(at + kMark.size());
      const std::string_view mark = take_line(page);
      add_table(page, split(mark.substr(0, mark.find(" -->")), "; "), out);
    }
  return out;
}

}  // namespace

std::string key_text(std::string_view kind, std::string_view path) {
  static const Texts texts = read_pages();
  while (true) {
    for (const std::string_view of : {kind, std::string_view("*")})
      if (const auto found = texts.find(std::string(of) + " " + std::string(path)); found != texts.end())
        return found->second;
    const std::size_t dot = path.find('.');
    if (dot == std::string_view::npos) return {};
    path.remove_prefix(dot + 1);
  }
}

}  // namespace handsim::app
