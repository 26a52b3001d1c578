#include "handsim/study/spec_reader.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/yaml_files.h"

namespace handsim::study {

namespace {

constexpr std::size_t kMostSteps = 100;

}  // namespace

std::vector<double> read_steps(MapReader& reader, std::string_view key, bool required) {
  std::vector<double> steps;
  const YamlNode* list = reader.list(key, required, kMostSteps);
  if (!list) return steps;
  for (std::size_t i = 0; i < list->items.size(); ++i)
    if (const auto step = read_number(list->items[i], fmt::format("{}.{}", reader.path_of(key), i),
                                      kStepRange, reader.diagnostics()))
      steps.push_back(*step);
  std::sort(steps.rbegin(), steps.rend());
  if (required && steps.empty()) reader.problem(key, "no step", "at least one step");
  return steps;
}

std::string flow_text(const YamlNode& node) {
  std::vector<std::string> parts;
  switch (node.kind) {
    case YamlNode::Kind::null:
      return "~";
    case YamlNode::Kind::scalar:
      if (!node.quoted) return node.text;
      {
        std::string text = node.text;
        for (std::size_t at = 0; (at = text.find_first_of("\"\\", at)) != std::string::npos; at += 2)
          text.insert(at, 1, '\\');
        return "\"" + text + "\"";
      }
    case YamlNode::Kind::sequence:
      for (const YamlNode& item : node.items) parts.push_back(flow_text(item));
      return fmt::format("[{}]", fmt::join(parts, ", "));
    case YamlNode::Kind::map:
      for (const YamlEntry& entry : node.entries) parts.push_back(entry.key + ": " + flow_text(entry.value));
      return fmt::format("{{{}}}", fmt::join(parts, ", "));
  }
  return {};
}

std::vector<std::string> read_set(MapReader& reader, std::string_view key) {
  std::vector<std::string> set;
  const YamlNode* map = reader.child(key);
  if (!map) return set;
  if (map->kind != YamlNode::Kind::map)
    reader.problem(key, map->described(), "a mapping of dotted keys to values");
  for (const YamlEntry& entry : map->entries) set.push_back(entry.key + "=" + flow_text(entry.value));
  return set;
}

std::optional<std::filesystem::path> scene_path(const YamlNode& node, const std::string& key,
                                                Diagnostics& diagnostics) {
  if (auto path = named_file(node, key)) return path;
  diagnostics.problems.push_back({node.place(), key, node.described(), need_file(node, key, "scene")});
  return std::nullopt;
}

std::optional<std::filesystem::path> read_scene_path(MapReader& reader, bool required) {
  const YamlNode* node = reader.child("scene");
  if (!node && required) reader.problem("scene", "nothing", "the path of a scene file");
  if (!node) return std::nullopt;
  return scene_path(*node, reader.path_of("scene"), reader.diagnostics());
}

}  // namespace handsim::study
