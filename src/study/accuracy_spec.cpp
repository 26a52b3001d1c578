#include <algorithm>

#include <fmt/format.h>

#include "handsim/core/yaml_reader.h"
#include "handsim/scene/file_kind.h"
#include "handsim/study/accuracy.h"

namespace handsim::study {

namespace {

const Quantity kStep = {Dimension::time, 1e-6, 0.1};

std::vector<double> read_steps(MapReader& reader, std::string_view key, bool required) {
  std::vector<double> steps;
  const YamlNode* list = reader.list(key, required);
  if (!list) return steps;
  for (std::size_t i = 0; i < list->items.size(); ++i)
    if (const auto step = read_number(list->items[i], fmt::format("{}.{}", reader.path_of(key), i), kStep,
                                      reader.diagnostics()))
      steps.push_back(*step);
  std::sort(steps.rbegin(), steps.rend());
  if (required && steps.empty()) reader.problem(key, "no step", "at least one step");
  return steps;
}

/// `{solver.erp: 0.2}` as overrides.
std::vector<std::string> read_set(MapReader& reader, std::string_view key) {
  std::vector<std::string> set;
  const YamlNode* map = reader.child(key);
  if (!map) return set;
  if (map->kind != YamlNode::Kind::map)
    reader.problem(key, map->described(), "a mapping of dotted keys to values");
  for (const YamlEntry& entry : map->entries) {
    if (entry.value.kind != YamlNode::Kind::scalar)
      reader.diagnostics().problems.push_back({entry.value.place(), reader.path_of(key) + "." + entry.key,
                                               entry.value.described(), "a single value"});
    set.push_back(entry.key + "=" + entry.value.text);
  }
  return set;
}

std::filesystem::path beside(const YamlNode& node) {
  return (std::filesystem::path(node.place().file).parent_path() / node.text).lexically_normal();
}

std::optional<std::filesystem::path> read_scene_path(MapReader& reader, bool required) {
  const YamlNode* node = reader.child("scene");
  if (!node && required) reader.problem("scene", "nothing", "the path of a scene file");
  if (!node) return std::nullopt;
  if (node->kind == YamlNode::Kind::scalar && std::filesystem::is_regular_file(beside(*node)))
    return beside(*node);
  reader.problem("scene", node->described(), "the path of a scene file, relative to this file");
  return std::nullopt;
}

AccuracyMethod read_method(MapReader reader, const std::vector<double>& steps) {
  AccuracyMethod method;
  method.name = reader.text("name");
  method.set = read_set(reader, "set");
  method.scene = read_scene_path(reader, false);
  if (reader.has("observe")) method.observe = reader.text("observe");
  if (reader.has("line")) method.line = reader.text("line");
  method.steps = read_steps(reader, "steps", false);
  if (method.steps.empty()) method.steps = steps;
  reader.finish();
  return method;
}

/// `{accuracy: 1e-4}` as numbers.
std::vector<std::pair<std::string, double>> read_settings(MapReader& reader) {
  std::vector<std::pair<std::string, double>> settings;
  const YamlNode* map = reader.child("set");
  if (!map) return settings;
  if (map->kind != YamlNode::Kind::map)
    reader.problem("set", map->described(), "a mapping of names to numbers");
  for (const YamlEntry& entry : map->entries)
    if (const auto value =
            read_number(entry.value, reader.path_of("set") + "." + entry.key, {}, reader.diagnostics()))
      settings.emplace_back(entry.key, *value);
  return settings;
}

AccuracyMethod read_peer(MapReader reader, const std::vector<double>& steps) {
  AccuracyMethod method;
  method.name = reader.text("name");
  method.peer.emplace();
  method.peer->program = reader.name("program");
  method.peer->method = reader.name("method");
  method.peer->settings = read_settings(reader);
  if (reader.has("line")) method.line = reader.text("line");
  method.steps = read_steps(reader, "steps", false);
  if (method.steps.empty()) method.steps = steps;
  reader.finish();
  return method;
}

}  // namespace

AccuracySpec load_accuracy(const std::filesystem::path& path) {
  YamlNode root = load_yaml(path);
  Diagnostics diagnostics;
  if (!scene::is_of_kind(root, "", scene::FileKind::study, diagnostics)) throw Error(diagnostics.problems);
  MapReader reader(root, "", diagnostics);
  AccuracySpec spec;
  spec.title = reader.text("title", "what accuracy costs");
  spec.scene = read_scene_path(reader, true).value_or("");
  spec.reference =
      reader.choice<Reference>("reference", {{"slider_crank_iftomm", Reference::slider_crank_iftomm},
                                             {"slider_crank_torque", Reference::slider_crank_torque},
                                             {"method", Reference::method},
                                             {"smallest_step", Reference::smallest_step}});
  spec.reference_set = read_set(reader, "reference_set");
  if (reader.has("reference_set") != (spec.reference == Reference::method))
    reader.problem("reference_set",
                   reader.has("reference_set") ? "overrides for a reference that is no method" : "nothing",
                   "overrides exactly where reference is method");
  if (reader.has("observe")) spec.observe = reader.text("observe");
  if (reader.has("kind")) {
    std::vector<std::pair<std::string_view, scene::SceneKind>> words;
    for (std::size_t k = 0; k < scene::kSceneKindNames.size(); ++k)
      words.emplace_back(scene::kSceneKindNames[k], static_cast<scene::SceneKind>(k));
    spec.kind = reader.choice<scene::SceneKind>("kind", words);
  }
  spec.sample_every = reader.number("sample_every", kStep, 0.01);
  spec.early = reader.number("early", {Dimension::time, 0, 1e5}, 0.5);
  spec.repeats = reader.integer("repeats", 1, 1000, 5);
  const std::vector<double> steps = read_steps(reader, "steps", true);
  spec.plot_steps = read_steps(reader, "plot_steps", false);
  if (YamlNode* methods = reader.list("methods", true))
    for (std::size_t i = 0; i < methods->items.size(); ++i)
      spec.methods.push_back(
          read_method(MapReader(methods->items[i], fmt::format("methods.{}", i), diagnostics), steps));
  if (YamlNode* peers = reader.list("peers", false))
    for (std::size_t i = 0; i < peers->items.size(); ++i)
      spec.methods.push_back(
          read_peer(MapReader(peers->items[i], fmt::format("peers.{}", i), diagnostics), steps));
  if (spec.methods.empty()) reader.problem("methods", "no method", "at least one method");
  reader.finish();
  diagnostics.throw_if_any();
  return spec;
}

}  // namespace handsim::study
