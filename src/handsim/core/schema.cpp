#include "handsim/core/schema.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/schema_recorder.h"

namespace handsim {

namespace {

using Setting = SchemaRecorder::Setting;

/// Writes a value at its path; replaces values of another kind on the way.
void put(YamlNode& tree, const Setting& setting) {
  YamlNode* node = &tree;
  for (std::string_view rest = setting.path; !rest.empty();) {
    const std::string_view key = first_key(rest);
    if (key == "0") {
      if (node->kind != YamlNode::Kind::sequence) *node = yaml_sequence();
      if (node->items.empty()) node->items.push_back(yaml_map());
      node = &node->items.front();
    } else {
      if (node->kind != YamlNode::Kind::map) *node = yaml_map();
      YamlNode* found = node->find(key);
      node = found ? found : &yaml_put(*node, std::string(key), yaml_map());
    }
  }
  *node = setting.value;
}

YamlNode with(YamlNode tree, const Setting& setting) {
  put(tree, setting);
  return tree;
}

/// Runs a reader until it asks for no new key. Values enable and disable other keys: each setting is
/// therefore read with only the settings that led to it, and also together with all other keys.
Json explore(const SchemaSource& source, SchemaRecorder& recorder) {
  std::vector<Setting> settings;
  std::vector<YamlNode> waiting = {yaml_map()};
  YamlNode full = yaml_map();
  const auto read_waiting = [&] {
    while (!waiting.empty()) {
      const YamlNode tree = std::move(waiting.back());
      waiting.pop_back();
      Diagnostics diagnostics;
      diagnostics.recorder = &recorder;
      YamlNode copy = tree;
      source.read(copy, diagnostics);
      for (Setting& setting : recorder.end_run()) {
        waiting.push_back(with(tree, setting));
        if (setting.usual) put(full, setting);
        settings.push_back(std::move(setting));
      }
    }
  };
  read_waiting();
  for (std::size_t before = 0; before < settings.size();) {
    before = settings.size();
    waiting.push_back(full);
    for (const Setting& setting : settings)
      if (!setting.usual) waiting.push_back(with(full, setting));
    read_waiting();
  }
  return recorder.schema();
}

const SchemaSource& find_source(std::string_view kind, std::span<const SchemaSource> sources) {
  const auto found = std::ranges::find_if(sources, [&](const auto& source) { return source.kind == kind; });
  if (found == sources.end()) throw std::logic_error("no schema source of " + std::string(kind));
  return *found;
}

/// Writes what each key means before what its values are.
void describe(Json& schema, std::string_view kind, const std::string& path, const KeyText& text_of) {
  if (schema.contains("properties"))
    for (auto& [key, property] : schema["properties"].items()) {
      const std::string own = path.empty() ? key : path + "." + key;
      describe(property, kind, own, text_of);
      const std::string text = text_of(kind, own), values = property.value("description", std::string());
      if (!text.empty()) property["description"] = values.empty() ? text : text + ": " + values;
    }
  for (const char* part : {"items", "additionalProperties"})
    if (schema.contains(part) && schema[part].is_object()) describe(schema[part], kind, path, text_of);
  if (schema.contains("anyOf"))
    for (Json& each : schema["anyOf"]) describe(each, kind, path, text_of);
}

}  // namespace

std::string json_schema(std::string_view kind, std::span<const SchemaSource> sources,
                        const KeyText& text_of) {
  // A key that goes or changes its meaning raises the version (CONTRIBUTING.md).
  Json out = {{"$schema", "https://json-schema.org/draft/2020-12/schema"},
              {"$comment", "schema version 1"},
              {"title", "handsim: " + std::string(kind)}};
  SchemaRecorder root;
  const auto described = [&](std::string_view of, SchemaRecorder& recorder) {
    Json schema = explore(find_source(of, sources), recorder);
    if (text_of) describe(schema, of, "", text_of);
    return schema;
  };
  out.update(described(kind, root));
  std::set<std::string> waiting = root.kinds();
  while (!waiting.empty()) {
    const std::string next = waiting.extract(waiting.begin()).value();
    SchemaRecorder recorder;
    out["$defs"][definition_name(next)] = described(next, recorder);
    for (const std::string& other : recorder.kinds())
      if (!out["$defs"].contains(definition_name(other))) waiting.insert(other);
  }
  return out.dump(1) + "\n";
}

}  // namespace handsim
