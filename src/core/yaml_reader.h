// Reads values out of a YAML tree and checks them: every problem is collected with its place, an unknown key
// is a problem that names the nearest known key, and each default that is used is written into the tree.
// After reading, the tree is the resolved input.
#pragma once

#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "handsim/core/pose.h"
#include "handsim/core/units.h"
#include "handsim/core/words.h"
#include "handsim/core/yaml.h"

namespace handsim {

class SchemaRecorder;

/// What was found while reading. Problems stop the work once all of them are known; warnings do not.
struct Diagnostics {
  std::vector<Problem> problems;
  std::vector<std::string> warnings;
  YamlBudget budget;                   ///< of the files that are read on the way
  SchemaRecorder* recorder = nullptr;  ///< notes what readers ask for: json_schema() sets it

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

inline constexpr std::size_t kNoLimit = std::numeric_limits<std::size_t>::max();
/// Most items of a list where its reader states no other number.
inline constexpr std::size_t kMostItems = 10'000;

/// A value that a reader takes apart by itself.
struct ValueForm {
  std::vector<YamlNode::Kind> kinds;  ///< the usual one first
  std::string need;                   ///< for messages
  bool required = true;
  std::vector<std::string> words = {};  ///< if a scalar or an item can only be one of these
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
  /// Two numbers, low then high; nothing where it is absent or, with a problem, wrong.
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
    const std::size_t index = choice_index(key, names, default_name);
    return words[index].second;
  }

  /// Whether the key is there. Asking makes it a known key.
  bool has(std::string_view key);
  /// The value of a key of any kind, or null. Asking makes it a known key.
  YamlNode* child(std::string_view key);
  /// A value of one of the form's kinds, no empty text; null, with a problem where required, otherwise.
  YamlNode* value(std::string_view key, const ValueForm& form);
  /// A list of at most `most` items; null, with a problem where required, otherwise.
  YamlNode* list(std::string_view key, bool required, std::size_t most = kMostItems);
  /// Reads each map of a list; of more than `most` or fewer than `least` none, with a problem. The list may
  /// be absent where `least` is 0.
  void each(std::string_view key, std::size_t least, std::size_t most,
            const std::function<void(MapReader)>& read);
  /// A required list of texts, or one text where that is enough.
  std::vector<std::string> texts(std::string_view key, std::size_t least, std::size_t most,
                                 const std::string& need);
  /// An optional map of names of any kind to texts.
  std::map<std::string, std::string> named_texts(std::string_view key);
  /// A file that the key names, read into its place, or the block itself; null, with a problem, where it
  /// cannot be read. @param kind such as `a person`.
  YamlNode* file_or_block(std::string_view key, std::string_view kind, bool required = true);
  /// The keys of a map with names of any kind; of more than `most` none, with a problem.
  std::vector<std::string> keys(std::size_t most = 1000);
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
  /// Dotted path of a key of this map; of the map where the key is empty.
  std::string path_of(std::string_view key) const;
  Diagnostics& diagnostics() { return *diagnostics_; }
  YamlNode& node() { return *node_; }

  /// A problem of the key of an entry of this map, at the key's place.
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
  YamlNode* find(std::string_view key);
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

}  // namespace handsim
