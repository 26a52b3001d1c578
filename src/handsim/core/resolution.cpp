#include "handsim/core/resolution.h"

namespace handsim {

YamlNode Resolution::applied(YamlNode tree, std::string_view path, std::size_t first) const {
  for (std::size_t i = first; i < entries_.size(); ++i) {
    const Entry& entry = entries_[i];
    std::string_view inner = entry.path;
    if (!path.empty() && !take_key(inner, path)) continue;
    if (YamlNode* found = value_at(tree, inner)) {
      if (!entry.fills) *found = entry.value;
      continue;
    }
    // Within something that the tree lacks: of a file that it does not name.
    const std::size_t dot = inner.rfind('.');
    YamlNode* map = dot == std::string_view::npos ? &tree : value_at(tree, inner.substr(0, dot));
    if (map && map->kind == YamlNode::Kind::map)
      yaml_put(*map, std::string(inner.substr(dot + 1)), entry.value);
  }
  return tree;
}

}  // namespace handsim
