// Parses YAML text into a tree of nodes with their places in the file, and writes it back. Stricter than
// YAML: each key occurs once, no alias is inside its own value, file size, nesting and memory are limited.
// yaml_reader.h reads values out of the tree.
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
  /// The same values at the same places. At once where both are copies of one tree.
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

/// Largest file and deepest nesting accepted. A scene together with the files that it names has to stay
/// within these limits, so that its resolved.yaml can be read again.
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

/// @param name the file's name in messages. @param budget reduced by the tree's memory; without it the file
/// has a full budget.
/// @throws Error (input) with every syntax error, duplicate key and bad alias, or if the budget is used up.
YamlNode parse_yaml(const std::string& text, const std::string& name, YamlBudget& budget);
YamlNode parse_yaml(const std::string& text, const std::string& name);

/// A file that has not changed since it was last loaded is not parsed again. Any thread.
/// @throws Error (input) if the file is missing, not a regular file, too large, or invalid YAML.
YamlNode load_yaml(const std::filesystem::path& path, YamlBudget& budget);
YamlNode load_yaml(const std::filesystem::path& path);

/// Canonical YAML that parses back to the same tree.
std::string emit_yaml(const YamlNode& node);

/// Nodes for trees made in code.
YamlNode yaml_scalar(std::string text, bool quoted = false);
YamlNode yaml_map();
YamlNode yaml_sequence();
/// Adds or replaces `key` in a map.
YamlNode& yaml_put(YamlNode& map, std::string key, YamlNode value);

/// Replaces a scalar that names a YAML file (relative to the file that contains it) by that file's tree;
/// other nodes stay as they are.
/// @throws Error (input) at the scalar's place if the file cannot be read, or the file's own problems.
void follow_reference(YamlNode& node, const std::string& key, YamlBudget& budget);

/// Puts one tree over another: maps key by key; of lists whose items all have a `name`, each item over the
/// one of its name, and new ones before those of the base; anything else replaces what was there.
void put_over(YamlNode& base, const YamlNode& over);

/// Sets the value at a dotted path, e.g. `solver.step=5 ms` or `hands.0.side=left`, following file
/// references and adding map keys on the way. A path has at most kYamlMaxDepth keys.
/// @throws Error (input) naming the path if a node on it is neither map nor list.
void apply_override(YamlNode& root, std::string_view assignment, YamlBudget& budget);
void apply_override(YamlNode& root, std::string_view assignment);

}  // namespace handsim
