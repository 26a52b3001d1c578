#include "handsim/scene/read/blocks.h"

#include <fmt/format.h>

namespace handsim::scene {

std::string item_path(std::string_view list, std::size_t i) { return fmt::format("{}.{}", list, i); }

Pose read_pose(MapReader& reader, std::optional<Vec3> fallback) {
  Pose pose;
  pose.p = reader.vector("position", kCoordinate, std::move(fallback));
  pose.q = reader.rotation("rotation");
  return pose;
}

YamlNode* referenced(MapReader& reader, std::string_view key, FileKind kind, bool required) {
  YamlNode* node = reader.file_or_block(key, described(kind), required);
  return node && is_of_kind(*node, reader.path_of(key), kind, reader.diagnostics()) ? node : nullptr;
}

bool inline_file(MapReader& block, FileKind kind,
                 bool (*overridden)(const YamlNode& entry, const std::string& key)) {
  YamlNode& entry = block.node();
  Diagnostics& diagnostics = block.diagnostics();
  if (!block.has("file")) return true;
  YamlNode* file = block.value("file", {{YamlNode::Kind::scalar}, "the path of its file"});
  if (!file) return false;
  const std::string key = block.path_of("file");
  try {
    follow_reference(*file, key, diagnostics.budget);
  } catch (const Error& error) {
    diagnostics.add(error);
    return false;
  }
  if (!is_of_kind(*file, key, kind, diagnostics)) return false;
  YamlNode content = std::move(*file);
  entry.entries.remove_if([](const YamlEntry& of) { return of.key == "file"; });
  const YamlNode own = entry;
  for (YamlEntry& of : content.entries)
    if (!overridden(own, of.key)) entry.entries.push_back(std::move(of));
  return true;
}

}  // namespace handsim::scene
