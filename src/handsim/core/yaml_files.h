// YAML files: finds those that values name, loads them, each parsed once for thousands of loads, and puts
// them in the place of their names, one tree over another, and the values of `--set` into a tree.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "handsim/core/yaml.h"

namespace handsim {

/// Not parsed again unless changed. Any thread. @throws Error (input): missing, irregular, too large, invalid
YamlNode load_yaml(const std::filesystem::path& path, YamlBudget& budget);
YamlNode load_yaml(const std::filesystem::path& path);

/// The YAML file that a scalar names: a path relative to the file that contains it, or else a shipped file by
/// its name, as `median_man`; nothing if there is neither. @param key dotted path, see shipped_folder()
std::optional<std::filesystem::path> named_file(const YamlNode& node, std::string_view key);

/// What named_file() finds, for the message about a scalar that names nothing, with the nearest names.
/// @param what `YAML`, `scene`
std::string need_file(const YamlNode& node, std::string_view key, std::string_view what);

/// Replaces a scalar that names a YAML file, or a shipped one (named_file()), by that file's tree.
/// @throws Error (input) at the scalar's place if the file cannot be read, or the file's own problems
void follow_reference(YamlNode& node, const std::string& key, YamlBudget& budget);

/// Puts one tree over another: maps key by key; of lists whose items all have a `name`, each item over the
/// one of its name, and new ones before those of the base; anything else replaces what was there.
void put_over(YamlNode& base, const YamlNode& over);

/// Sets the value at a path (`solver.step=5 ms`, `hands.0.side=left`), follows file references and adds map
/// keys; kYamlMaxDepth keys at most. @throws Error (input) if a node on the path is neither map nor list
void apply_override(YamlNode& root, std::string_view assignment, YamlBudget& budget);
void apply_override(YamlNode& root, std::string_view assignment);

}  // namespace handsim
