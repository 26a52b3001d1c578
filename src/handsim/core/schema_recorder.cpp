#include "handsim/core/schema_recorder.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace handsim {

namespace {

Json without_default(Json type) {
  type.erase("default");
  return type;
}

/// Adds a type to those of a key. Two lists of words become one; a default that depends on keys is left out.
void merge(std::vector<Json>& types, Json type) {
  for (Json& known : types) {
    if (known == type) return;
    if (without_default(known) == without_default(type)) {
      known.erase("default");
      return;
    }
    if (known.contains("enum") && type.contains("enum")) {
      for (const Json& word : type["enum"])
        if (std::ranges::find(known["enum"], word) == known["enum"].end()) known["enum"].push_back(word);
      if (known.value("default", Json()) != type.value("default", Json())) known.erase("default");
      return;
    }
    const bool container = type.contains("type") && (type["type"] == "object" || type["type"] == "array");
    if (container && known.contains("type") && known["type"] == type["type"]) return known.update(type);
  }
  types.push_back(std::move(type));
}

/// The type of this name among those of a key, added if missing.
Json& type_of(std::vector<Json>& types, const char* name) {
  for (Json& type : types)
    if (type.contains("type") && type["type"] == name) return type;
  return types.emplace_back(Json{{"type", name}});
}

constexpr const char* kSample = "sample";

YamlNode sample_list(std::vector<YamlNode> items) {
  YamlNode list = yaml_sequence();
  for (YamlNode& item : items) list.items.push_back(std::move(item));
  return list;
}

YamlNode sample_number(const Quantity& quantity, double near) {
  return yaml_scalar(number_text(std::clamp(near, quantity.min, quantity.max)));
}

/// Where the reader wants a text it also accepts numbers and truth values.
Json text_type() { return {{"type", {"string", "number", "boolean"}}}; }

/// A bare number in SI, or a text with a unit of its dimension.
Json number_type(const Quantity& quantity) {
  std::string pattern = "^ *-?([0-9]+\\.?[0-9]*|\\.[0-9]+)([eE][-+]?[0-9]+)?";
  std::vector<std::string> units;
  for (const std::string_view unit : units_of(quantity.dimension)) {
    std::string& escaped = units.emplace_back();
    for (const char c : unit) escaped += c == '(' || c == ')' ? fmt::format("\\{}", c) : std::string(1, c);
  }
  if (!units.empty()) pattern += fmt::format(" *({})?", fmt::join(units, "|"));
  Json out = {{"type", {"number", "string"}}, {"description", quantity.need()}};
  if (std::isfinite(quantity.min)) out[quantity.above_min ? "exclusiveMinimum" : "minimum"] = quantity.min;
  if (std::isfinite(quantity.max)) out["maximum"] = quantity.max;
  out["pattern"] = pattern + " *$";
  return out;
}

Json array_type(const Json& items, std::size_t least, std::size_t most) {
  Json out = {{"type", "array"}};
  if (!items.is_null()) out["items"] = items;
  if (least > 0) out["minItems"] = least;
  if (most < kNoLimit) out["maxItems"] = most;
  return out;
}

}  // namespace

std::string_view first_key(std::string_view& path) {
  const std::size_t dot = path.find('.');
  const std::string_view key = path.substr(0, dot);
  path = dot == std::string_view::npos ? std::string_view() : path.substr(dot + 1);
  return key;
}

SchemaRecorder::Node& SchemaRecorder::at(std::string_view path) {
  Node* node = &root_;
  while (!path.empty()) {
    const std::string_view key = first_key(path);
    auto child = std::ranges::find_if(node->children, [&](const Node& each) { return each.key == key; });
    if (child == node->children.end()) child = node->children.insert(child, Node{std::string(key)});
    node = &*child;
  }
  return *node;
}

void SchemaRecorder::record(const std::string& path, std::string_view key, KeyForm form) {
  const std::string whole = path.empty() ? std::string(key) : path + "." + std::string(key);
  Node& node = at(whole);
  for (Json& type : form.types) merge(node.types, std::move(type));
  if (form.required && !(optional_ && path.starts_with(*optional_))) required_[path].insert(std::string(key));
  for (std::size_t i = 0; i < form.samples.size(); ++i)
    if (known_.emplace(whole, emit_yaml(form.samples[i])).second)
      found_.push_back({whole, std::move(form.samples[i]), i == 0});
}

void SchemaRecorder::record_file(const std::string& path, std::string_view key, std::string_view kind,
                                 bool required) {
  kinds_.emplace(kind);
  record(path, key, file_form(kind, required));
}

std::vector<SchemaRecorder::Setting> SchemaRecorder::end_run() {
  for (const std::string& path : visited_) {
    std::optional<std::set<std::string>>& always = at(path).required;
    const std::set<std::string>& now = required_[path];
    if (!always) always = now;
    std::erase_if(*always, [&](const std::string& key) { return !now.contains(key); });
  }
  visited_.clear();
  required_.clear();
  optional_.reset();
  return std::exchange(found_, {});
}

Json SchemaRecorder::build(const Node& node) {
  std::vector<Json> types = node.types;
  for (const Node& child : node.children) {
    if (child.key == "0") {
      type_of(types, "array")["items"] = build(child);
    } else if (child.key == "*") {
      type_of(types, "object")["additionalProperties"] = build(child);
    } else {
      type_of(types, "object")["properties"][child.key] = build(child);
    }
  }
  if (node.required && !node.required->empty()) type_of(types, "object")["required"] = *node.required;
  if (node.closed)
    if (Json& type = type_of(types, "object"); !type.contains("additionalProperties"))
      type["additionalProperties"] = false;
  if (types.empty()) return Json::object();
  return types.size() == 1 ? types.front() : Json{{"anyOf", types}};
}

KeyForm presence_form() { return {{}, {yaml_scalar(kSample), yaml_map(), sample_list({yaml_map()})}}; }

KeyForm number_form(const Quantity& quantity, std::optional<double> fallback, bool required) {
  Json type = number_type(quantity);
  if (fallback) type["default"] = *fallback;
  return {{type}, {sample_number(quantity, 1)}, required};
}

KeyForm integer_form(int min, int max, int fallback) {
  const Json type = {{"type", "integer"}, {"minimum", min}, {"maximum", max}, {"default", fallback}};
  return {{type}, {yaml_scalar(std::to_string(fallback))}};
}

KeyForm text_form(const std::optional<std::string>& fallback, bool required) {
  Json type = text_type();
  if (fallback) type["default"] = *fallback;
  return {{type}, {yaml_scalar(kSample)}, required};
}

KeyForm name_form() {
  Json type = text_type();
  type["pattern"] = "^[A-Za-z0-9_-]{1,64}$";
  return {{type}, {yaml_scalar(kSample)}, true};
}

KeyForm flag_form(bool fallback) {
  return {{{{"type", "boolean"}, {"default", fallback}}}, {yaml_scalar("true"), yaml_scalar("false")}};
}

KeyForm vector_form(const Quantity& quantity, const std::optional<Vec3>& fallback) {
  Json type = array_type(number_type(quantity), 3, 3);
  if (fallback) type["default"] = {fallback->x(), fallback->y(), fallback->z()};
  const YamlNode one = sample_number(quantity, 1);
  return {{type}, {sample_list({one, one, one})}, !fallback};
}

KeyForm range_form(const Quantity& quantity, bool required) {
  return {{array_type(number_type(quantity), 2, 2)},
          {sample_list({sample_number(quantity, 0), sample_number(quantity, 1)})},
          required};
}

KeyForm choice_form(const std::vector<std::string_view>& words, std::optional<std::string_view> fallback) {
  Json type = {{"enum", words}};
  if (fallback) type["default"] = *fallback;
  std::vector<YamlNode> samples;
  for (const std::string_view word : words) samples.push_back(yaml_scalar(std::string(word)));
  return {{type}, std::move(samples), !fallback};
}

KeyForm texts_form(std::size_t least, std::size_t most, const std::string& need) {
  KeyForm out{{array_type(text_type(), least, most)}, {sample_list({yaml_scalar(kSample)})}, true};
  if (least <= 1) out.types.insert(out.types.begin(), text_type());
  for (Json& type : out.types) type["description"] = need;
  return out;
}

KeyForm list_form(std::size_t least, std::size_t most) {
  return {{array_type({}, least, most)}, {sample_list({yaml_map()})}, least > 0};
}

KeyForm map_form(bool required) { return {{{{"type", "object"}}}, {yaml_map()}, required}; }

KeyForm value_form(const ValueForm& form) {
  KeyForm out;
  out.required = form.required;
  for (const YamlNode::Kind kind : form.kinds) {
    Json type = form.words.empty() ? text_type() : Json{{"enum", form.words}};
    YamlNode sample = yaml_scalar(form.words.empty() ? kSample : form.words.front());
    if (kind == YamlNode::Kind::sequence) {
      type = array_type(form.words.empty() ? Json() : type, 0, kNoLimit);
      sample = sample_list({yaml_map()});
    } else if (kind == YamlNode::Kind::map) {
      type = {{"type", "object"}};
      sample = yaml_map();
    }
    type["description"] = form.need;
    out.types.push_back(std::move(type));
    out.samples.push_back(std::move(sample));
  }
  return out;
}

std::string definition_name(std::string_view kind) {
  std::string name(kind.substr(kind.find(' ') + 1));
  std::ranges::replace(name, ' ', '_');
  return name;
}

KeyForm file_form(std::string_view kind, bool required) {
  KeyForm out;
  out.types.push_back({{"$ref", "#/$defs/" + definition_name(kind)}});
  out.types.push_back(
      {{"type", "string"}, {"description", "the path of its file, or the name of a shipped one"}});
  out.samples = {yaml_map()};
  out.required = required;
  return out;
}

}  // namespace handsim
