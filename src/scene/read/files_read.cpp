#include "handsim/scene/read/files_read.h"

#include <set>

namespace handsim::scene {

namespace {

/// YAML files are named at each value that stands in them.
void collect(const YamlNode& node, std::set<std::filesystem::path>& out) {
  if (node.file) out.insert(*node.file);
  for (const YamlNode& item : node.items) collect(item, out);
  for (const YamlEntry& entry : node.entries) collect(entry.value, out);
}

}  // namespace

std::vector<std::filesystem::path> files_read(const Scene& scene) {
  std::set<std::filesystem::path> out;
  collect(scene.resolved, out);
  for (const InputFile& input : scene.inputs) out.insert(input.path);
  return {out.begin(), out.end()};
}

}  // namespace handsim::scene
