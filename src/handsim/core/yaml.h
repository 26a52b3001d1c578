// Parses YAML text into a tree of nodes with their places, and writes it back; yaml_reader.h reads its
// values. Each key occurs once, no alias is inside its own value, file size, nesting and memory are limited.
#pragma once

#include <filesystem>
#include <list>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/core/error.h"
#include "handsim/core/shared_list.h"

namespace handsim {

struct YamlEntry;

/// One value of a YAML document. Copies share what is below them (shared_list.h).
struct YamlNode {
  enum class Kind { null, scalar, sequence, map };

  Kind kind = Kind::null;
  std::string text;                          ///< scalar
  bool quoted = false;                       ///< scalar in quotes: text, never a number or a truth value
  SharedList<std::vector<YamlNode>> items;   ///< sequence
  SharedList<std::list<YamlEntry>> entries;  ///< map, in the order of the file; keys may be added
  std::shared_ptr<const std::string> file;   ///< name as given by the user
  int line = 1;
  int column = 1;

  Place place() const { return {file ? *file : std::string(), line, column}; }
  YamlNode* find(std::string_view key);
  const YamlNode* find(std::string_view key) const;
  /// True if both have equal values at equal places. Fast for copies of one tree.
  bool same_as(const YamlNode& other) const;
  /// For messages: `0.5`, `"x"`, `a list`, `a mapping`, `nothing`.
  std::string described() const;
};

struct YamlEntry {
  std::string key;
  int line = 1;
  int column = 1;
  YamlNode value;
};

/// Largest file and deepest nesting, of a scene with all its files: its resolved.yaml can be read again.
inline constexpr std::size_t kYamlMaxBytes = 32U << 20U;
inline constexpr int kYamlMaxDepth = 64;
/// Most memory for the trees of one scene, with aliases expanded, referenced files and `--set`.
inline constexpr std::size_t kYamlMaxMemory = 256U << 20U;
/// Counted for each value and key in addition to the bytes of its text.
inline constexpr std::size_t kYamlNodeBytes = 128;

/// Memory that the trees still to be read may take [bytes].
struct YamlBudget {
  std::size_t left = kYamlMaxMemory;
};

/// @param name of the file in messages. @param budget reduced by the tree's memory; without it, a full one.
/// @throws Error (input) with every syntax error, duplicate key and bad alias, or if the budget is used up
YamlNode parse_yaml(const std::string& text, const std::string& name, YamlBudget& budget);
YamlNode parse_yaml(const std::string& text, const std::string& name);

/// Canonical YAML that parses back to the same tree.
std::string emit_yaml(const YamlNode& node);

/// Nodes for trees made in code.
YamlNode yaml_scalar(std::string text, bool quoted = false);
YamlNode yaml_map();
/// At the place of another node.
YamlNode yaml_map(const YamlNode& place);
YamlNode yaml_sequence();
/// Adds or replaces `key` in a map.
YamlNode& yaml_put(YamlNode& map, std::string key, YamlNode value);

/// Removes a key from the start of a dotted path; false if the path does not begin with it.
bool take_key(std::string_view& path, std::string_view key);
/// The value at a dotted path of keys and indices, or null. Of keys with dots, the longest that fits.
YamlNode* value_at(YamlNode& root, std::string_view path);
const YamlNode* value_at(const YamlNode& root, std::string_view path);

}  // namespace handsim
