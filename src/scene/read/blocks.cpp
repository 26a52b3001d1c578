#include "handsim/scene/read/blocks.h"

#include <limits>

#include <fmt/format.h>

namespace handsim::scene {

std::string item_path(std::string_view list, std::size_t i) { return fmt::format("{}.{}", list, i); }

void each_block(MapReader& reader, std::string_view key, std::size_t most,
                const std::function<void(MapReader)>& read) {
  YamlNode* list = reader.list(key, false, std::numeric_limits<std::size_t>::max());
  if (!list) return;
  if (list->items.size() > most)
    return reader.problem(key, list->described(), fmt::format("at most {} {}", most, key));
  for (std::size_t i = 0; i < list->items.size(); ++i)
    read(MapReader(list->items[i], item_path(reader.path_of(key), i), reader.diagnostics()));
}

Pose read_pose(MapReader& reader, std::optional<Vec3> fallback) {
  Pose pose;
  pose.p = reader.vector("position", kCoordinate, std::move(fallback));
  pose.q = reader.rotation("rotation");
  return pose;
}

YamlNode* referenced(MapReader& reader, std::string_view key, FileKind kind) {
  YamlNode* node = reader.child(key);
  if (!node) {
    reader.problem(key, "nothing",
                   fmt::format("{}: the path of its file, or the block itself", described(kind)));
    return nullptr;
  }
  try {
    follow_reference(*node, reader.path_of(key), reader.diagnostics().budget);
    return is_of_kind(*node, reader.path_of(key), kind, reader.diagnostics()) ? node : nullptr;
  } catch (const Error& error) {
    reader.diagnostics().take(error);
    return nullptr;
  }
}

bool inline_file(MapReader& block, FileKind kind,
                 bool (*overridden)(const YamlNode& entry, const std::string& key)) {
  YamlNode& entry = block.node();
  Diagnostics& diagnostics = block.diagnostics();
  YamlNode* file = entry.find("file");
  if (!file) return true;
  const std::string key = block.path_of("file");
  try {
    follow_reference(*file, key, diagnostics.budget);
  } catch (const Error& error) {
    diagnostics.take(error);
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
