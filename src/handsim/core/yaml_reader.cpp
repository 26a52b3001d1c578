#include "handsim/core/yaml_reader.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/input_file.h"
#include "handsim/core/schema_recorder.h"

namespace handsim {

namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Message with the correct form of a number that has a decimal comma; nothing if no such form is accepted.
template <class Accepted>
std::optional<std::string> without_comma(const std::string& text, const Accepted& accepted) {
  const std::size_t comma = text.find(',');
  if (comma == std::string::npos || comma == 0 || comma + 1 == text.size() || !is_digit(text[comma - 1]) ||
      !is_digit(text[comma + 1]))
    return std::nullopt;
  const std::string head = text.substr(0, comma), tail = text.substr(comma + 1);
  const std::size_t digits = std::min(tail.find_first_not_of("0123456789"), tail.size());
  const bool thousands = digits == 3 && head.find_first_not_of("+-0") != std::string::npos;
  const bool decimal(accepted(head + "." + tail)), whole(thousands && accepted(head + tail));
  if (!decimal) return whole ? std::optional("no comma: " + head + tail) : std::nullopt;
  return fmt::format("a decimal point in place of a comma: {}.{}{}", head, tail,
                     whole ? fmt::format(" (or {}{})", head, tail) : "");
}

YamlNode vector_node(const Vec3& v) {
  YamlNode list = yaml_sequence();
  for (int i = 0; i < 3; ++i) list.items.push_back(yaml_scalar(number_text(v[i])));
  return list;
}

std::optional<double> allowed_number(const std::string& text, const Quantity& quantity) {
  const std::optional<double> value = parse_quantity(text, quantity.dimension);
  return value && quantity.allows(*value) ? value : std::nullopt;
}

std::optional<double> allowed_number(const YamlNode& node, const Quantity& quantity) {
  return node.kind == YamlNode::Kind::scalar ? allowed_number(node.text, quantity) : std::nullopt;
}

std::optional<int> allowed_integer(const std::string& text, int min, int max) {
  const std::optional<double> value = parse_number(text);
  const bool good = value && *value >= min && *value <= max && *value == std::floor(*value);
  return good ? std::optional(static_cast<int>(*value)) : std::nullopt;
}

}  // namespace

std::optional<double> read_number(const YamlNode& node, const std::string& path, const Quantity& quantity,
                                  Diagnostics& diagnostics) {
  if (const std::optional<double> value = allowed_number(node, quantity)) return value;
  const auto comma =
      without_comma(node.text, [&](const std::string& text) { return allowed_number(text, quantity); });
  diagnostics.problems.push_back(
      {node.place(), path, node.described(), comma.value_or(quantity.need(node.text))});
  return std::nullopt;
}

MapReader::MapReader(const YamlNode& node, std::string path, Diagnostics& diagnostics)
    : node_(&node),
      path_(std::move(path)),
      diagnostics_(&diagnostics),
      problems_before_(diagnostics.problems.size()) {
  if (node.kind == YamlNode::Kind::map) {
    if (diagnostics.recorder) diagnostics.recorder->record_map(path_);
    return;
  }
  broken_ = true;
  diagnostics.problems.push_back({node.place(), path_, node.described(), "a mapping (key: value)"});
}

std::string MapReader::path_of(std::string_view key) const {
  if (key.empty()) return path_;
  return path_.empty() ? std::string(key) : fmt::format("{}.{}", path_, key);
}

bool MapReader::has(std::string_view key) { return child(key) != nullptr; }

const YamlNode* MapReader::child(std::string_view key) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, presence_form());
  return find(key);
}

const YamlNode* MapReader::find(std::string_view key) {
  if (std::ranges::find(known_, key) == known_.end()) known_.emplace_back(key);
  return node_->find(key);
}

template <class Need>
const YamlNode* MapReader::find_or_report(std::string_view key, bool required, const Need& need) {
  const YamlNode* found = find(key);
  if (!found && required && !broken_)
    diagnostics_->problems.push_back({node_->place(), path_of(key), "nothing", need()});
  return found;
}

std::optional<double> MapReader::number_at(const YamlNode& node, std::string_view key,
                                           const Quantity& quantity) {
  const std::optional<std::string> split = split_number(key);
  if (const auto value = split ? std::nullopt : allowed_number(node, quantity)) return value;
  YamlNode whole = node;
  if (split) whole.text = *split;
  return read_number(whole, path_of(key), quantity, *diagnostics_);
}

std::optional<double> MapReader::item(const YamlNode& list, std::string_view key, std::size_t i,
                                      const Quantity& quantity) {
  if (const std::optional<double> value = allowed_number(list.items[i], quantity)) return value;
  return read_number(list.items[i], fmt::format("{}.{}", path_of(key), i), quantity, *diagnostics_);
}

void MapReader::note_default(std::string_view key, YamlNode value) {
  if (!broken_) diagnostics_->resolution.fill(path_of(key), std::move(value));
}

/// `{stature: 1,7}` is YAML for a stature of 1 and a key 7 without a value: `1,7`, which is reported once.
std::optional<std::string> MapReader::split_number(std::string_view key) {
  auto at = std::ranges::find_if(node_->entries, [&](const YamlEntry& entry) { return entry.key == key; });
  if (at == node_->entries.end() || at->value.kind != YamlNode::Kind::scalar) return std::nullopt;
  const auto next = std::next(at);
  if (next == node_->entries.end() || next->value.kind != YamlNode::Kind::null || next->line != at->line)
    return std::nullopt;
  std::string text = at->value.text + "," + next->key;
  if (!without_comma(text, [](const std::string&) { return true; })) return std::nullopt;
  known_.push_back(next->key);
  return text;
}

double MapReader::number(std::string_view key, const Quantity& quantity, std::optional<double> fallback) {
  if (auto* recorder = diagnostics_->recorder)
    recorder->record(path_, key, number_form(quantity, fallback, !fallback));
  const double harmless = fallback.value_or(
      std::isfinite(quantity.min) && std::isfinite(quantity.max) ? 0.5 * (quantity.min + quantity.max) : 1.0);
  const YamlNode* found = find_or_report(key, !fallback, [&] { return quantity.need(); });
  if (found) return number_at(*found, key, quantity).value_or(harmless);
  if (fallback) note_default(key, yaml_scalar(number_text(*fallback)));
  return harmless;
}

std::optional<double> MapReader::maybe_number(std::string_view key, const Quantity& quantity) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, number_form(quantity, {}, false));
  const YamlNode* found = find(key);
  return found ? number_at(*found, key, quantity) : std::nullopt;
}

int MapReader::integer(std::string_view key, int min, int max, int fallback) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, integer_form(min, max, fallback));
  const YamlNode* found = find(key);
  if (!found) {
    note_default(key, yaml_scalar(std::to_string(fallback)));
    return fallback;
  }
  const std::string need = fmt::format("a whole number, {} to {}", min, max);
  const auto accepted = [&](const std::string& text) { return allowed_integer(text, min, max); };
  const std::optional<std::string> split = split_number(key);
  const std::string& text = split ? *split : found->text;
  const bool scalar = found->kind == YamlNode::Kind::scalar;
  if (const auto value = scalar && !split ? accepted(text) : std::nullopt) return *value;
  problem(key, split ? text : found->described(), without_comma(text, accepted).value_or(need));
  return fallback;
}

std::string MapReader::text(std::string_view key, std::optional<std::string> fallback) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, text_form(fallback, !fallback));
  const YamlNode* found = find_or_report(key, !fallback, [] { return "a text"; });
  if (!found) {
    if (fallback) note_default(key, yaml_scalar(*fallback, true));
    return fallback.value_or("");
  }
  const bool one_value = found->kind == YamlNode::Kind::scalar && !found->text.empty();
  if (one_value && !find_bad_byte(found->text)) return found->text;
  problem(key, found->described(), one_value ? "a text without control characters" : "a text");
  return fallback.value_or("");
}

std::optional<std::string> MapReader::maybe_text(std::string_view key) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, text_form({}, false));
  return find(key) ? std::optional(text(key)) : std::nullopt;
}

void MapReader::take_base(std::string_view key) {
  constexpr int kMost = 8;
  if (auto* recorder = diagnostics_->recorder) {
    recorder->record(path_, key, text_form({}, false));
    // What the file lacks, its base has.
    if (node_->find(key)) recorder->make_optional(path_);
  }
  if (!find(key) || diagnostics_->recorder) return;
  try {
    for (int i = 0; const YamlNode* found = node_->find(key); ++i) {
      if (i == kMost || found->kind != YamlNode::Kind::scalar) {
        problem(key, i == kMost ? "files that are based on each other" : found->described(),
                "the path of a file of the same kind, relative to this file");
        return;
      }
      YamlNode base = *found, over = *node_;
      follow_reference(base, path_of(key), diagnostics_->budget);
      over.entries.remove_if([&](const YamlEntry& entry) { return entry.key == key; });
      put_over(base, over);
      read_instead(std::move(base));
    }
  } catch (const Error& error) {
    diagnostics_->add(error);
  }
}

std::string MapReader::name(std::string_view key) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, name_form());
  constexpr const char* kNeed = "a name of letters, digits, _ and -, at most 64 of them";
  const YamlNode* found = find_or_report(key, true, [] { return kNeed; });
  if (!found) return "";
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  };
  const std::string& word = found->text;
  if (!word.empty() && word.size() <= 64 && std::ranges::all_of(word, plain)) return word;
  problem(key, found->described(), kNeed);
  return "";
}

bool MapReader::flag(std::string_view key, bool fallback) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, flag_form(fallback));
  const YamlNode* found = find(key);
  if (!found) {
    note_default(key, yaml_scalar(fallback ? "true" : "false"));
    return fallback;
  }
  if (found->kind == YamlNode::Kind::scalar && !found->quoted &&
      (found->text == "true" || found->text == "false"))
    return found->text == "true";
  problem(key, found->described(), "true or false");
  return fallback;
}

Vec3 MapReader::vector(std::string_view key, const Quantity& quantity, std::optional<Vec3> fallback) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, vector_form(quantity, fallback));
  const auto need = [&] { return "a list of three numbers, each " + quantity.need(); };
  const YamlNode* found = find_or_report(key, !fallback, need);
  Vec3 out = fallback.value_or(Vec3::UnitX());
  if (!found) {
    if (fallback) note_default(key, vector_node(*fallback));
    return out;
  }
  if (found->kind != YamlNode::Kind::sequence || found->items.size() != 3) {
    problem(key, found->described(),
            need() + (found->items.size() > 3 ? "; use a decimal point, a comma separates numbers" : ""));
    return out;
  }
  for (int i = 0; i < 3; ++i)
    out[i] = item(*found, key, static_cast<std::size_t>(i), quantity).value_or(out[i]);
  return out;
}

std::optional<std::pair<double, double>> MapReader::maybe_range(std::string_view key,
                                                                const Quantity& quantity, bool required) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, range_form(quantity, required));
  const auto need = [&] { return "a list of two, low then high, each " + quantity.need(); };
  const YamlNode* found = find_or_report(key, required, need);
  if (!found) return std::nullopt;
  if (found->kind != YamlNode::Kind::sequence || found->items.size() != 2) {
    problem(key, found->described(), need());
    return std::nullopt;
  }
  const auto low = item(*found, key, 0, quantity);
  const auto high = item(*found, key, 1, quantity);
  if (!low || !high) return std::nullopt;
  if (*low < *high) return std::pair(*low, *high);
  problem(key, fmt::format("{} to {}", found->items[0].text, found->items[1].text), "the lower value first");
  return std::nullopt;
}

Quat MapReader::rotation(std::string_view key) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, map_form(false));
  const YamlNode* found = find(key);
  if (!found) return Quat::Identity();
  MapReader reader(*found, path_of(key), *diagnostics_);
  const Vec3 axis = reader.direction("axis");
  const double angle = reader.number("angle", {Dimension::angle, -100, 100});
  reader.finish();
  return Quat(Eigen::AngleAxisd(angle, axis));
}

Vec3 MapReader::direction(std::string_view key) {
  const Vec3 v = vector(key, {Dimension::none, -1e6, 1e6});
  if (v.norm() >= 1e-9) return v.normalized();
  problem(key, "a vector of length 0", "a direction");
  return Vec3::UnitX();
}

std::size_t MapReader::choice_index(std::string_view key, const std::vector<std::string_view>& names,
                                    std::optional<std::string_view> fallback) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, choice_form(names, fallback));
  const auto known = [&] { return std::vector<std::string>(names.begin(), names.end()); };
  const YamlNode* found = find_or_report(key, !fallback, [&] { return list_of(known()); });
  if (!found && fallback) note_default(key, yaml_scalar(std::string(*fallback)));
  if (found && found->kind == YamlNode::Kind::scalar) {
    const auto at = std::ranges::find(names, found->text);
    if (at != names.end()) return static_cast<std::size_t>(at - names.begin());
  }
  if (found) problem(key, found->described(), need_word(found->text, known()));
  if (!fallback) return 0;
  return static_cast<std::size_t>(std::ranges::find(names, *fallback) - names.begin());
}

const YamlNode* MapReader::list(std::string_view key, bool required, std::size_t most) {
  if (auto* recorder = diagnostics_->recorder)
    recorder->record(path_, key, list_form(required ? 1 : 0, most));
  const YamlNode* found = find_or_report(key, required, [] { return "a list"; });
  const bool is_list = found && found->kind == YamlNode::Kind::sequence;
  if (!found || (is_list && found->items.size() <= most)) return found;
  problem(key, found->described(), is_list ? fmt::format("at most {} of them", most) : "a list");
  return nullptr;
}

const YamlNode* MapReader::value(std::string_view key, const ValueForm& form) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, value_form(form));
  const YamlNode* found = find_or_report(key, form.required, [&] { return form.need; });
  if (!found) return nullptr;
  const bool empty_text = found->kind == YamlNode::Kind::scalar && found->text.empty();
  if (!empty_text && std::ranges::find(form.kinds, found->kind) != form.kinds.end()) return found;
  problem(key, found->described(), form.need);
  return nullptr;
}

void MapReader::each(std::string_view key, std::size_t least, std::size_t most,
                     const std::function<void(MapReader)>& read) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, list_form(least, most));
  const YamlNode* found = list(key, least > 0, kNoLimit);
  if (!found) return;
  if (found->items.size() < least || found->items.size() > most) {
    const std::string range = least > 0 ? fmt::format("{} to", least) : "at most";
    return problem(key, found->described(), fmt::format("{} {} {}", range, most, key));
  }
  for (std::size_t i = 0; i < found->items.size(); ++i)
    read(MapReader(found->items[i], fmt::format("{}.{}", path_of(key), i), *diagnostics_));
}

std::vector<std::string> MapReader::texts(std::string_view key, std::size_t least, std::size_t most,
                                          const std::string& need) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, texts_form(least, most, need));
  const YamlNode* found = find_or_report(key, true, [&] { return need; });
  if (!found) return {};
  const bool one = found->kind == YamlNode::Kind::scalar && least <= 1;
  std::vector<std::string> out;
  for (const YamlNode& item : one ? SharedList<std::vector<YamlNode>>{*found} : found->items)
    if (item.kind == YamlNode::Kind::scalar && !item.text.empty()) out.push_back(item.text);
  if (out.size() == (one ? 1 : found->items.size()) && out.size() >= least && out.size() <= most) return out;
  problem(key, found->described(), need);
  return {};
}

std::map<std::string, std::string> MapReader::named_texts(std::string_view key) {
  std::map<std::string, std::string> out;
  if (!has(key)) return out;
  MapReader texts = map(key);
  for (const std::string& name : texts.keys()) out[name] = texts.text(name);
  return out;
}

const YamlNode* MapReader::file_or_block(std::string_view key, std::string_view kind, bool required,
                                         const std::string& otherwise) {
  // The schema of its kind lists its keys.
  if (auto* recorder = diagnostics_->recorder) {
    recorder->record_file(path_, key, kind, required);
    known_.emplace_back(key);
    return nullptr;
  }
  using Kind = YamlNode::Kind;
  const YamlNode* found =
      value(key, {{Kind::map, Kind::scalar},
                  fmt::format("{}: the path or name of its file, or the block itself", kind),
                  required});
  if (found ? found->kind == Kind::map : otherwise.empty() || node_->find(key)) return found;
  YamlNode file = found ? *found : yaml_map(*node_);
  if (!found) {
    file.kind = Kind::scalar;
    file.text = otherwise;
  }
  try {
    follow_reference(file, path_of(key), diagnostics_->budget);
    return &resolve(key, std::move(file));
  } catch (const Error& error) {
    diagnostics_->add(error);
    return nullptr;
  }
}

std::filesystem::path MapReader::file_path(std::string_view key, const YamlNode& value) {
  const std::filesystem::path beside = std::filesystem::path(value.place().file).parent_path() / value.text;
  std::filesystem::path path = absolute_path(beside);
  YamlNode absolute = value;
  absolute.text = path.string();
  resolve(key, std::move(absolute));
  diagnostics_->resolution.files.push_back(path);
  return path;
}

std::vector<std::string> MapReader::keys(std::size_t most) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, "*", presence_form());
  std::vector<std::string> out;
  if (node_->entries.size() > most)
    problem("", fmt::format("{} keys", node_->entries.size()), fmt::format("at most {}", most));
  else
    for (const YamlEntry& entry : node_->entries) out.push_back(entry.key);
  return out;
}

MapReader MapReader::map(std::string_view key) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, map_form(false));
  const YamlNode* found = find(key);
  if (!found) found = &diagnostics_->resolution.fill(path_of(key), yaml_map(*node_));
  if (!broken_) return {*found, path_of(key), *diagnostics_};
  // The parent's problem has been reported; the child reports nothing more.
  MapReader silent = *this;
  silent.node_ = found;
  silent.path_ = path_of(key);
  silent.known_.clear();
  return silent;
}

MapReader MapReader::required_map(std::string_view key, const std::string& need) {
  if (auto* recorder = diagnostics_->recorder) recorder->record(path_, key, map_form(true));
  if (find_or_report(key, true, [&] { return need; })) return map(key);
  MapReader silent = map(key);
  silent.broken_ = true;
  return silent;
}

void MapReader::problem(std::string_view key, std::string got, std::string need) {
  if (broken_) return;
  const YamlNode* found = value_at(*node_, key);
  diagnostics_->problems.push_back(
      {(found ? *found : *node_).place(), path_of(key), std::move(got), std::move(need)});
}

void MapReader::warning(std::string_view key, const std::string& text) {
  const YamlNode* found = value_at(*node_, key);
  const std::string where = (found ? *found : *node_).place().text();
  diagnostics_->warnings.push_back(fmt::format("{}{}: {}", where, path_of(key), text));
}

void MapReader::unknown_key(const YamlEntry& entry, std::string got, const std::vector<std::string>& known) {
  const Place place{entry.value.file ? *entry.value.file : node_->place().file, entry.line, entry.column};
  diagnostics_->problems.push_back({place, path_of(entry.key), std::move(got), need_word(entry.key, known)});
}

void MapReader::finish() {
  if (broken_) return;
  if (diagnostics_->recorder) diagnostics_->recorder->close(path_);
  for (const YamlEntry& entry : node_->entries) {
    if (std::ranges::find(known_, entry.key) != known_.end()) continue;
    std::ranges::sort(known_);
    unknown_key(entry, "an unknown key", known_);
  }
}

}  // namespace handsim
