#include "handsim/app/key_texts.h"

#include <map>
#include <regex>

#include "handsim/core/text.h"

namespace handsim::app {

namespace assets {
extern const std::string_view control_md, keys_md, motion_md, persons_md, rollouts_md, scenes_md;
}  // namespace assets

namespace {

using Texts = std::map<std::string, std::string, std::less<>>;

/// Calls `use` with each place of a text that is as the pattern.
template <class Use>
void each_match(const std::string& text, const char* pattern, const Use& use) {
  const std::regex as(pattern);
  for (std::sregex_iterator at(text.begin(), text.end(), as), end; at != end; ++at) use(*at);
}

/// Adds a table's rows, from `| `key` | ... | meaning |`. @param blocks `scene objects; scene bodies`
void add_table(std::string_view rows, const std::string& blocks, Texts& out) {
  const std::regex row(R"(\|([^|]*)\|(?:.*\|)? ?([^|]*?):? *\|)"), link(R"(`|\[([^\]]*)\]\([^)]*\))"),
      list(R"(\[\])");
  while (rows.starts_with('|')) {
    const std::string line(take_line(rows));
    std::smatch cells;
    if (!std::regex_match(line, cells, row)) continue;
    const std::string keys = std::regex_replace(cells[1].str(), list, ""),
                      text = std::regex_replace(cells[2].str(), link, "$1");
    // `choice: [a, b]` is of the key choice.
    each_match(keys, "`([^`:]*)[^`]*`", [&](const std::smatch& key) {
      each_match(blocks, R"(([\w*]+)( [\w.]+)?(; |$))", [&](const std::smatch& block) {
        out.emplace(block[1].str() + (block[2].matched ? block[2].str() + "." : " ") + key[1].str(), text);
      });
    });
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
      add_table(page, std::string(mark.substr(0, mark.find(" -->"))), out);
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
