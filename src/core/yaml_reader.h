// Reads values out of a YAML tree and checks them: every problem is collected with its place, an unknown key
// is a problem that names the nearest known key, and each default that is used is written into the tree.
// After reading, the tree is the resolved input.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "handsim/core/pose.h"
#include "handsim/core/units.h"
#include "handsim/core/yaml.h"

namespace handsim {

/// What was found while reading. Problems stop the work once all of them are known; warnings do not.
struct Diagnostics {
  std::vector<Problem> problems;
  std::vector<std::string> warnings;
  YamlBudget budget;  ///< of the files that are read on the way

  /// @throws Error with all problems in the order of the files. A problem of a file that is read twice is
  /// reported once.
  void throw_if_any() const;
  /// The list holds as many problems as are reported; reading can stop.
  bool full() const { return problems.size() >= kMostProblems; }
  /// Keeps the problems of an Error thrown by a part.
  void take(const Error& error) {
    problems.insert(problems.end(), error.problems().begin(), error.problems().end());
  }
};

/// Reads one map of a tree. A value that is missing or wrong becomes a problem; a harmless value is returned
/// instead, so that reading goes on. Call finish() last.
class MapReader {
 public:
  /// A node that is not a map is a problem. `path` is its dotted path in messages.
  MapReader(YamlNode& node, std::string path, Diagnostics& diagnostics);

  /// A number in SI. Without a fallback the key is required.
  double number(std::string_view key, const Quantity& quantity, std::optional<double> fallback = {});
  /// An optional number.
  std::optional<double> maybe_number(std::string_view key, const Quantity& quantity);
  int integer(std::string_view key, int min, int max, int fallback);
  /// Text that is not empty and has no control characters other than line ends and tabs.
  std::string text(std::string_view key, std::optional<std::string> fallback = {});
  /// Optional text; no default is written.
  std::optional<std::string> maybe_text(std::string_view key);
  /// A required word of letters, digits, `_` and `-`, valid in column names and file names.
  std::string name(std::string_view key);
  bool flag(std::string_view key, bool fallback);
  Vec3 vector(std::string_view key, const Quantity& quantity, std::optional<Vec3> fallback = {});
  /// Three numbers that are not all 0, normalised. Required.
  Vec3 direction(std::string_view key);
  /// Two numbers, low then high.
  std::optional<std::pair<double, double>> maybe_range(std::string_view key, const Quantity& quantity);
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
    const std::size_t index = choice_index(key, names, default_name);
    return words[index].second;
  }

  /// Whether the key is there. Asking makes it a known key.
  bool has(std::string_view key);
  /// The value of a key, or null. Asking makes it a known key.
  YamlNode* child(std::string_view key);
  /// A list of at most `most` items; null, with a problem where required, otherwise.
  YamlNode* list(std::string_view key, bool required, std::size_t most = 10'000);
  /// A map under this key. If absent, an empty one is written, which then receives the defaults.
  MapReader map(std::string_view key);
  /// A required map; `need` says what it holds. If absent, that is one problem, and its keys are not
  /// reported.
  MapReader required_map(std::string_view key, const std::string& need);

  /// True while nothing read since this reader was made has a problem. Checks that compare values ask it
  /// first, so that one mistake gives one message.
  bool sound() const { return diagnostics_->problems.size() == problems_before_; }
  void problem(std::string_view key, std::string got, std::string need);
  void warning(std::string_view key, const std::string& text);
  /// Dotted path of a key of this map.
  std::string path_of(std::string_view key) const;
  Diagnostics& diagnostics() { return *diagnostics_; }
  YamlNode& node() { return *node_; }

  /// Reports every key that was never asked for.
  void finish();

 private:
  template <class E>
  static std::string_view name_of(const std::vector<std::pair<std::string_view, E>>& words, E value) {
    for (const auto& word : words)
      if (word.second == value) return word.first;
    return {};
  }
  std::size_t choice_index(std::string_view key, const std::vector<std::string_view>& names,
                           std::optional<std::string_view> fallback);
  /// The node of a key, with a problem where it is missing and no default exists.
  YamlNode* wanted(std::string_view key, bool required, const std::string& need);
  void write_default(std::string_view key, YamlNode value);
  bool has_decimal_comma(std::string_view key);

  YamlNode* node_;
  std::string path_;
  Diagnostics* diagnostics_;
  std::size_t problems_before_;
  bool broken_ = false;  ///< not a map: reported once, and nothing else
  std::set<std::string, std::less<>> known_;
};

/// A number at a node, for items of lists.
/// @returns nothing, and a problem, where it is none or out of range.
std::optional<double> read_number(const YamlNode& node, const std::string& path, const Quantity& quantity,
                                  Diagnostics& diagnostics);

/// What is needed in place of a word that is none of those known: `one of a, b (nearest: b)`.
std::string need_word(std::string_view got, const std::vector<std::string>& known);

/// ` (nearest: b)`, or nothing where none is near enough to be meant.
std::string nearest_hint(std::string_view got, const std::vector<std::string>& known);

/// The word of `known` nearest to `word`, if any is near enough to be meant.
std::optional<std::string> nearest_word(std::string_view word, const std::vector<std::string>& known);

}  // namespace handsim
