// Finds the file that a value of a YAML file names: one of the user, or a shipped one.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "handsim/core/yaml.h"

namespace handsim {

/// The YAML file that a scalar names: a path relative to the file that contains it, or else a shipped file by
/// its name, as `median_man`; nothing if there is neither. @param key dotted path, see shipped_folder()
std::optional<std::filesystem::path> named_file(const YamlNode& node, std::string_view key);

/// What named_file() finds, for the message about a scalar that names nothing, with the nearest names.
/// @param what `YAML`, `scene`
std::string need_file(const YamlNode& node, std::string_view key, std::string_view what);

}  // namespace handsim
