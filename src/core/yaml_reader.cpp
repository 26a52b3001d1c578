#include "handsim/core/yaml_reader.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/text.h"

namespace handsim {

namespace {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

std::string lower_case(std::string_view text) {
  std::string out(text);
  for (char& c : out)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return out;
}

std::string list_of(const std::vector<std::string>& words) {
  return words.size() == 1 ? words.front() : "one of " + fmt::format("{}", fmt::join(words, ", "));
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// How to write a number that has a decimal comma; nothing if it has none.
std::optional<std::string> without_comma(const std::string& text) {
  const std::size_t comma = text.find(',');
  if (comma == std::string::npos || comma == 0 || comma + 1 == text.size() || !is_digit(text[comma - 1]) ||
      !is_digit(text[comma + 1]))
    return std::nullopt;
  const std::string head = text.substr(0, comma), tail = text.substr(comma + 1);
  const std::size_t digits = std::min(tail.find_first_not_of("0123456789"), tail.size());
  const bool thousands = digits == 3 && head.find_first_not_of("+-0") != std::string::npos;
  return fmt::format("a decimal point in place of a comma: {}.{}{}", head, tail,
                     thousands ? fmt::format(" (or {}{})", head, tail) : "");
}

/// The value of a key or of a dotted path of keys, or null.
const YamlNode* at_path(const YamlNode& map, std::string_view key) {
  if (const YamlNode* found = map.find(key)) return found;
  const std::size_t dot = key.find('.');
  if (dot == std::string_view::npos) return nullptr;
  const YamlNode* inner = map.find(key.substr(0, dot));
  return inner ? at_path(*inner, key.substr(dot + 1)) : nullptr;
}

YamlNode vector_node(const Vec3& v) {
  YamlNode list = yaml_sequence();
  for (int i = 0; i < 3; ++i) list.items.push_back(yaml_scalar(number_text(v[i])));
  return list;
}

}  // namespace

std::string nearest_hint(std::string_view got, const std::vector<std::string>& known) {
  const std::optional<std::string> near = nearest_word(got, known);
  return near ? fmt::format(" (nearest: {})", *near) : "";
}

std::string need_word(std::string_view got, const std::vector<std::string>& known) {
  return list_of(known) + nearest_hint(got, known);
}

void Diagnostics::throw_if_any() const {
  if (problems.empty()) return;
  std::vector<std::string> files;
  // Problems are sorted by file, in the order of reading, then by place.
  const auto rank = [&](const Problem& problem) {
    const Place place = problem.place.value_or(Place{"", 0, 0});
    auto at = std::find(files.begin(), files.end(), place.file);
    if (at == files.end()) at = files.insert(files.end(), place.file);
    return std::tuple(at - files.begin(), place.line, place.column);
  };
  for (const Problem& problem : problems) rank(problem);
  std::vector<Problem> sorted = problems;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [&](const Problem& a, const Problem& b) { return rank(a) < rank(b); });
  // A file that is read twice gives equal problems under two paths; equal places are now neighbours.
  const auto same = [](const Problem& a, const Problem& b) {
    const auto last = [](const std::string& key) { return key.substr(key.rfind('.') + 1); };
    return a.place && last(a.key) == last(b.key) && a.got == b.got;
  };
  std::vector<Problem> once;
  for (Problem& problem : sorted) {
    bool said = false;
    for (auto other = once.rbegin(); other != once.rend() && rank(*other) == rank(problem); ++other)
      said = said || same(*other, problem);
    if (!said) once.push_back(std::move(problem));
  }
  throw Error(std::move(once));
}

std::optional<std::string> nearest_word(std::string_view word, const std::vector<std::string>& known) {
  std::optional<std::string> best;
  std::size_t best_distance = std::clamp<std::size_t>(word.size() / 3, word.size() < 4 ? 1 : 2, 3) + 1;
  for (const std::string& candidate : known) {
    // The distance is at least the difference in length; this also skips words of megabytes.
    if (word.size() >= candidate.size() + best_distance) continue;
    const std::size_t distance = edit_distance(lower_case(word), lower_case(candidate));
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

std::optional<double> read_number(const YamlNode& node, const std::string& path, const Quantity& quantity,
                                  Diagnostics& diagnostics) {
  if (node.kind == YamlNode::Kind::scalar)
    if (const std::optional<double> value = parse_quantity(node.text, quantity.dimension))
      if (quantity.allows(*value)) return value;
  const auto comma = node.kind == YamlNode::Kind::scalar ? without_comma(node.text) : std::nullopt;
  diagnostics.problems.push_back({node.place(), path, node.described(), comma ? *comma : quantity.need()});
  return std::nullopt;
}

MapReader::MapReader(YamlNode& node, std::string path, Diagnostics& diagnostics)
    : node_(&node),
      path_(std::move(path)),
      diagnostics_(&diagnostics),
      problems_before_(diagnostics.problems.size()) {
  if (node.kind == YamlNode::Kind::map) return;
  broken_ = true;
  diagnostics.problems.push_back({node.place(), path_, node.described(), "a mapping (key: value)"});
}

std::string MapReader::path_of(std::string_view key) const {
  return path_.empty() ? std::string(key) : fmt::format("{}.{}", path_, key);
}

bool MapReader::has(std::string_view key) { return child(key) != nullptr; }

YamlNode* MapReader::child(std::string_view key) {
  known_.emplace(key);
  return node_->find(key);
}

YamlNode* MapReader::wanted(std::string_view key, bool required, const std::string& need) {
  YamlNode* found = child(key);
  if (!found && required && !broken_)
    diagnostics_->problems.push_back({node_->place(), path_of(key), "nothing", need});
  return found;
}

void MapReader::write_default(std::string_view key, YamlNode value) {
  if (!broken_) yaml_put(*node_, std::string(key), std::move(value));
}

/// `{stature: 1,7}` is YAML for a stature of 1 and a key 7 without a value; reported once, here.
bool MapReader::has_decimal_comma(std::string_view key) {
  auto at = std::find_if(node_->entries.begin(), node_->entries.end(),
                         [&](const YamlEntry& entry) { return entry.key == key; });
  if (at == node_->entries.end() || at->value.kind != YamlNode::Kind::scalar) return false;
  const auto next = std::next(at);
  if (next == node_->entries.end() || next->value.kind != YamlNode::Kind::null || next->line != at->line)
    return false;
  const std::string text = at->value.text + "," + next->key;
  const auto need = without_comma(text);
  if (!need) return false;
  known_.insert(next->key);
  problem(key, text, *need);
  return true;
}

double MapReader::number(std::string_view key, const Quantity& quantity, std::optional<double> fallback) {
  const double harmless = fallback.value_or(
      std::isfinite(quantity.min) && std::isfinite(quantity.max) ? 0.5 * (quantity.min + quantity.max) : 1.0);
  const YamlNode* found = wanted(key, !fallback, quantity.need());
  if (found && has_decimal_comma(key)) return harmless;
  if (found) return read_number(*found, path_of(key), quantity, *diagnostics_).value_or(harmless);
  if (fallback) write_default(key, yaml_scalar(number_text(*fallback)));
  return harmless;
}

std::optional<double> MapReader::maybe_number(std::string_view key, const Quantity& quantity) {
  const YamlNode* found = child(key);
  if (!found || has_decimal_comma(key)) return std::nullopt;
  return read_number(*found, path_of(key), quantity, *diagnostics_);
}

int MapReader::integer(std::string_view key, int min, int max, int fallback) {
  const YamlNode* found = child(key);
  if (!found) {
    write_default(key, yaml_scalar(std::to_string(fallback)));
    return fallback;
  }
  if (has_decimal_comma(key)) return fallback;
  const std::optional<double> value =
      found->kind == YamlNode::Kind::scalar ? parse_number(found->text) : std::nullopt;
  if (value && *value >= min && *value <= max && *value == std::floor(*value))
    return static_cast<int>(*value);
  problem(key, found->described(), fmt::format("a whole number, {} to {}", min, max));
  return fallback;
}

std::string MapReader::text(std::string_view key, std::optional<std::string> fallback) {
  const YamlNode* found = wanted(key, !fallback, "a text");
  if (!found) {
    if (fallback) write_default(key, yaml_scalar(*fallback, true));
    return fallback.value_or("");
  }
  const bool one_value = found->kind == YamlNode::Kind::scalar && !found->text.empty();
  if (one_value && !find_bad_byte(found->text)) return found->text;
  problem(key, found->described(), one_value ? "a text without control characters" : "a text");
  return fallback.value_or("");
}

std::optional<std::string> MapReader::maybe_text(std::string_view key) {
  return has(key) ? std::optional(text(key)) : std::nullopt;
}

std::string MapReader::name(std::string_view key) {
  constexpr std::size_t kLongest = 64;
  const std::string need = "a name of letters, digits, _ and -, at most 64 of them";
  const YamlNode* found = wanted(key, true, need);
  if (!found) return "";
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  };
  const std::string& word = found->text;
  if (!word.empty() && word.size() <= kLongest && std::all_of(word.begin(), word.end(), plain)) return word;
  problem(key, found->described(), need);
  return "";
}

bool MapReader::flag(std::string_view key, bool fallback) {
  const YamlNode* found = child(key);
  if (!found) {
    write_default(key, yaml_scalar(fallback ? "true" : "false"));
    return fallback;
  }
  if (found->kind == YamlNode::Kind::scalar && !found->quoted &&
      (found->text == "true" || found->text == "false"))
    return found->text == "true";
  problem(key, found->described(), "true or false");
  return fallback;
}

Vec3 MapReader::vector(std::string_view key, const Quantity& quantity, std::optional<Vec3> fallback) {
  const std::string need = "a list of three numbers, each " + quantity.need();
  const YamlNode* found = wanted(key, !fallback, need);
  Vec3 out = fallback.value_or(Vec3::UnitX());
  if (!found) {
    if (fallback) write_default(key, vector_node(*fallback));
    return out;
  }
  if (found->kind != YamlNode::Kind::sequence || found->items.size() != 3) {
    problem(key, found->described(),
            need + (found->items.size() > 3 ? "; a number takes a decimal point, commas part numbers" : ""));
    return out;
  }
  for (int i = 0; i < 3; ++i)
    out[i] = read_number(found->items[static_cast<std::size_t>(i)], path_of(key) + "." + std::to_string(i),
                         quantity, *diagnostics_)
                 .value_or(out[i]);
  return out;
}

std::optional<std::pair<double, double>> MapReader::maybe_range(std::string_view key,
                                                                const Quantity& quantity) {
  const YamlNode* found = child(key);
  if (!found) return std::nullopt;
  if (found->kind != YamlNode::Kind::sequence || found->items.size() != 2) {
    problem(key, found->described(), "a list of two, low then high, each " + quantity.need());
    return std::nullopt;
  }
  const auto low = read_number(found->items[0], path_of(key) + ".0", quantity, *diagnostics_);
  const auto high = read_number(found->items[1], path_of(key) + ".1", quantity, *diagnostics_);
  if (!low || !high) return std::nullopt;
  if (!(*low < *high)) {
    problem(key, fmt::format("{} to {}", found->items[0].text, found->items[1].text),
            "the lower value first");
    return std::nullopt;
  }
  return std::pair(*low, *high);
}

Quat MapReader::rotation(std::string_view key) {
  YamlNode* found = child(key);
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
  const std::vector<std::string> known(names.begin(), names.end());
  const YamlNode* found = wanted(key, !fallback, list_of(known));
  if (!found && fallback) write_default(key, yaml_scalar(std::string(*fallback)));
  if (found && found->kind == YamlNode::Kind::scalar) {
    const auto at = std::find(names.begin(), names.end(), found->text);
    if (at != names.end()) return static_cast<std::size_t>(at - names.begin());
  }
  if (found) problem(key, found->described(), need_word(found->text, known));
  if (!fallback) return 0;
  return static_cast<std::size_t>(std::find(names.begin(), names.end(), *fallback) - names.begin());
}

YamlNode* MapReader::list(std::string_view key, bool required, std::size_t most) {
  YamlNode* found = wanted(key, required, "a list");
  const bool is_list = found && found->kind == YamlNode::Kind::sequence;
  if (!found || (is_list && found->items.size() <= most)) return found;
  problem(key, found->described(), is_list ? fmt::format("at most {} of them", most) : "a list");
  return nullptr;
}

MapReader MapReader::map(std::string_view key) {
  YamlNode* found = child(key);
  if (!found) found = &yaml_put(*node_, std::string(key), yaml_map());
  if (!broken_) return {*found, path_of(key), *diagnostics_};
  // The parent's problem has been reported; the child reports nothing more.
  MapReader silent = *this;
  silent.node_ = found;
  silent.path_ = path_of(key);
  silent.known_.clear();
  return silent;
}

MapReader MapReader::required_map(std::string_view key, const std::string& need) {
  if (wanted(key, true, need)) return map(key);
  MapReader silent = map(key);
  silent.broken_ = true;
  return silent;
}

void MapReader::problem(std::string_view key, std::string got, std::string need) {
  if (broken_) return;
  const YamlNode* found = at_path(*node_, key);
  diagnostics_->problems.push_back(
      {(found ? *found : *node_).place(), path_of(key), std::move(got), std::move(need)});
}

void MapReader::warning(std::string_view key, const std::string& text) {
  const YamlNode* found = at_path(*node_, key);
  const Place place = (found ? *found : *node_).place();
  // A tree that a program made has no file.
  const std::string where =
      place.file.empty() ? "" : fmt::format("{}:{}:{}: ", place.file, place.line, place.column);
  diagnostics_->warnings.push_back(fmt::format("{}{}: {}", where, path_of(key), text));
}

void MapReader::finish() {
  if (broken_) return;
  const std::vector<std::string> known(known_.begin(), known_.end());
  for (const YamlEntry& entry : node_->entries) {
    if (known_.contains(entry.key)) continue;
    const Place place{entry.value.file ? *entry.value.file : node_->place().file, entry.line, entry.column};
    diagnostics_->problems.push_back(
        {place, path_of(entry.key), "an unknown key", need_word(entry.key, known)});
  }
}

}  // namespace handsim
