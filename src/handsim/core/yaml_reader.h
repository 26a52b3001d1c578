// Reads values from a YAML tree and checks them. Collects every problem with its place, reports unknown keys
// with the nearest known one, and notes used defaults for the resolved text. The tree does not change.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "handsim/core/fields.h"
#include "handsim/core/pose.h"
#include "handsim/core/resolution.h"
#include "handsim/core/text.h"
#include "handsim/core/units.h"
#include "handsim/core/yaml_files.h"

namespace handsim {

class SchemaRecorder;

/// Problems and warnings found while reading. Problems stop the command after all are collected.
struct Diagnostics {
  std::vector<Problem> problems;
  std::vector<std::string> warnings;
  YamlBudget budget;                   ///< of the files that are still to be read
  Resolution resolution;               ///< defaults, and files that were read
  SchemaRecorder* recorder = nullptr;  ///< set by json_schema(): records the keys that readers ask for

  /// @throws Error with all problems by file and place; those of a file that is read twice once.
  void throw_if_any() const;
  /// True if the list holds as many problems as are reported: reading can stop.
  bool full() const { return problems.size() >= kMostProblems; }
  void add(const Error& error) {
    problems.insert(problems.end(), error.problems().begin(), error.problems().end());
  }
};

inline constexpr std::size_t kNoLimit = std::numeric_limits<std::size_t>::max();
inline constexpr std::size_t kMostItems = 10'000;  ///< Default limit on the items of a list.

/// A value that the caller parses itself.
struct ValueForm {
  std::vector<YamlNode::Kind> kinds;  ///< the usual one first
  std::string need;                   ///< for messages
  bool required = true;
  std::vector<std::string> words = {};  ///< of a scalar or an item; empty: any
};

/// Reads one map of a tree. A wrong value becomes a problem and a valid one is returned. Call finish() last.
class MapReader {
 public:
  /// A node that is not a map is a problem. `path` is its dotted path in messages.
  MapReader(const YamlNode& node, std::string path, Diagnostics& diagnostics);
  MapReader(YamlNode&& node, std::string path, Diagnostics& diagnostics) = delete;

  /// A number in SI. Without a fallback the key is required.
  double number(std::string_view key, const Quantity& quantity, std::optional<double> fallback = {});
  std::optional<double> maybe_number(std::string_view key, const Quantity& quantity);
  int integer(std::string_view key, int min, int max, int fallback);
  /// Text that is not empty and has no control characters other than line ends and tabs.
  std::string text(std::string_view key, std::optional<std::string> fallback = {});
  /// Optional text; no default is noted.
  std::optional<std::string> maybe_text(std::string_view key);
  /// If the key names a file: reads that file's map with this one over it (put_over); the file may name
  /// another.
  void take_base(std::string_view key);
  /// A required word of letters, digits, `_` and `-`, valid in column names and file names.
  std::string name(std::string_view key);
  bool flag(std::string_view key, bool fallback);
  Vec3 vector(std::string_view key, const Quantity& quantity, std::optional<Vec3> fallback = {});
  /// Three numbers that are not all 0, normalised. Required.
  Vec3 direction(std::string_view key);
  /// Two numbers, low then high; nothing if absent, or wrong, which is a problem.
  std::optional<std::pair<double, double>> maybe_range(std::string_view key, const Quantity& quantity,
                                                       bool required = false);
  /// `{axis: [x, y, z], angle: "90 deg"}`; the axis is normalised. Absent: no rotation.
  Quat rotation(std::string_view key);
  /// One word of a list.
  template <class E>
  E choice(std::string_view key, const std::vector<std::pair<std::string_view, E>>& words,
           std::optional<E> fallback = {}) {
    std::vector<std::string_view> names;
    for (const auto& word : words) names.push_back(word.first);
    const std::optional<std::string_view> default_name =
        fallback ? std::optional(name_of(words, *fallback)) : std::nullopt;
    return words[choice_index(key, names, default_name)].second;
  }

  /// Reads each key of the struct's list (fields.h). What is absent keeps the value that `out` has.
  template <class T>
  void fields(T& out) {
    T::fields([&](std::string_view key, auto member, const auto&... form) {
      if constexpr (std::is_member_pointer_v<decltype(member)>) {
        field(key, out.*member, form...);
      } else {
        auto value = field_value(out, member);
        field(key, value, form...);
        set_field(out, member, value);
      }
    });
  }

  /// True if the key exists. Makes it a known key.
  bool has(std::string_view key);
  /// The value of a key, of any kind, or null. Makes it a known key.
  const YamlNode* child(std::string_view key);
  /// A value of one of the form's kinds, not an empty text. Otherwise null, and a problem if required.
  const YamlNode* value(std::string_view key, const ValueForm& form);
  /// A list of at most `most` items. Otherwise null, and a problem unless the key is absent and optional.
  const YamlNode* list(std::string_view key, bool required, std::size_t most = kMostItems);
  /// Calls `read` for each map of a list of `least` to `most`; may be absent if `least` is 0. Else a problem.
  void each(std::string_view key, std::size_t least, std::size_t most,
            const std::function<void(MapReader)>& read);
  /// A required list of texts; a single text is accepted if `least` is at most 1.
  std::vector<std::string> texts(std::string_view key, std::size_t least, std::size_t most,
                                 const std::string& need);
  /// An optional map of free names to texts.
  std::map<std::string, std::string> named_texts(std::string_view key);
  /// A block, or the content of the file that the key names, which replaces the name in the resolved text.
  /// Null if it cannot be read, which is a problem, or is absent. @param kind such as `a person`. @param
  /// otherwise file of an absent key
  const YamlNode* file_or_block(std::string_view key, std::string_view kind, bool required = true,
                                const std::string& otherwise = {});
  /// All keys of a map with free names. More than `most` are a problem, and none is returned.
  std::vector<std::string> keys(std::size_t most = 1000);
  /// A map under this key; an empty one if absent.
  MapReader map(std::string_view key);
  /// A required map; `need` describes its content. If absent, that is one problem, and its keys are none.
  MapReader required_map(std::string_view key, const std::string& need);

  /// True if this reader found no problem. Test it before comparing values: one mistake gives one message.
  bool sound() const { return diagnostics_->problems.size() == problems_before_; }
  void problem(std::string_view key, std::string got, std::string need);
  void warning(std::string_view key, const std::string& text);
  /// Dotted path of a key of this map; of the map itself if the key is empty.
  std::string path_of(std::string_view key) const;
  Diagnostics& diagnostics() { return *diagnostics_; }
  const YamlNode& node() const { return *node_; }
  /// The resolved text has this value at a key, whatever the tree has there. @returns it, kept with the
  /// diagnostics
  const YamlNode& resolve(std::string_view key, YamlNode value) {
    return diagnostics_->resolution.replace(path_of(key), std::move(value));
  }
  /// The absolute path of a file that a value names beside its own file. The resolved text, which may stand
  /// in another folder, has it, and the resolution lists it.
  std::filesystem::path file_path(std::string_view key, const YamlNode& value);
  /// Reads another map instead; the resolved text has it, too.
  void read_instead(YamlNode map) { node_ = &resolve("", std::move(map)); }

  /// Reports a problem with the key of an entry of this map, at the key's place.
  void unknown_key(const YamlEntry& entry, std::string got, const std::vector<std::string>& known);
  /// Reports every key that was never asked for.
  void finish();

 private:
  template <class E>
  static std::string_view name_of(const std::vector<std::pair<std::string_view, E>>& words, E value) {
    for (const auto& word : words)
      if (word.second == value) return word.first;
    return {};
  }
  void field(std::string_view key, double& out, const Quantity& range, const auto&...) {
    out = number(key, range, out);
  }
  void field(std::string_view key, double& out, const Quantity& range, Required) { out = number(key, range); }
  void field(std::string_view key, double& out, const Quantity& range, Unsaid) {
    out = maybe_number(key, range).value_or(out);
  }
  void field(std::string_view key, std::optional<double>& out, const Quantity& range, const auto&...) {
    out = maybe_number(key, range);
  }
  void field(std::string_view key, int& out, const WholeRange& range, const auto&...) {
    out = integer(key, range.min, range.max, out);
  }
  void field(std::string_view key, std::uint64_t& out, const WholeRange& range, const auto&...) {
    out = static_cast<std::uint64_t>(integer(key, range.min, range.max, static_cast<int>(out)));
  }
  /// A block, `true` for its defaults, or `false` or nothing for none.
  template <class T>
  void field(std::string_view key, std::optional<T>& out, const auto&...) {
    const YamlNode* node = child(key);
    const bool word = node && node->kind == YamlNode::Kind::scalar;
    if (!node || (word && !flag(key, false))) return out.reset();
    MapReader block = word ? MapReader(resolve(key, yaml_map(*node)), path_of(key), *diagnostics_) : map(key);
    block.fields(out.emplace());
    block.finish();
  }
  void field(std::string_view key, bool& out, const auto&...) { out = flag(key, out); }
  template <class E>
  requires std::is_enum_v<E>
  void field(std::string_view key, E& out, const Words& words, const auto&...) {
    const std::vector<std::string_view> names(words.names.begin(), words.names.end());
    out = static_cast<E>(choice_index(key, names, names[static_cast<std::size_t>(out)]));
  }
  const YamlNode* find(std::string_view key);
  std::size_t choice_index(std::string_view key, const std::vector<std::string_view>& names,
                           std::optional<std::string_view> fallback);
  /// The node of a key, or null. A missing required key is a problem. `need()` makes the message's text.
  template <class Need>
  const YamlNode* find_or_report(std::string_view key, bool required, const Need& need);
  /// The number of a key, or an item of its list; nothing if wrong, which is a problem.
  std::optional<double> number_at(const YamlNode& node, std::string_view key, const Quantity& quantity);
  std::optional<double> item(const YamlNode& list, std::string_view key, std::size_t i,
                             const Quantity& quantity);
  void note_default(std::string_view key, YamlNode value);
  std::optional<std::string> split_number(std::string_view key);

  const YamlNode* node_;
  std::string path_;
  Diagnostics* diagnostics_;
  std::size_t problems_before_;
  bool broken_ = false;             ///< not a map: reported once; further problems are suppressed
  std::vector<std::string> known_;  ///< keys that were asked for
};

/// A number at a node, for items of lists; nothing, and a problem, if it is not a number or out of range.
std::optional<double> read_number(const YamlNode& node, const std::string& path, const Quantity& quantity,
                                  Diagnostics& diagnostics);

}  // namespace handsim
