// What the readers of study files share; private to this folder.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/core/yaml_reader.h"

namespace handsim::study {

inline const Quantity kStepRange = {Dimension::time, 1e-6, 0.1};

/// A list of steps, largest first.
std::vector<double> read_steps(MapReader& reader, std::string_view key, bool required);
/// `{solver.erp: 0.2, effects: [gravity]}` as overrides, `key.path=value`.
std::vector<std::string> read_set(MapReader& reader, std::string_view key);
/// A value as it would stand in one line of YAML.
std::string flow_text(const YamlNode& node);
/// The path of a scene file, relative to the file that the node stands in; nothing, with a problem, where
/// there is none.
std::optional<std::filesystem::path> scene_path(const YamlNode& node, const std::string& key,
                                                Diagnostics& diagnostics);
std::optional<std::filesystem::path> read_scene_path(MapReader& reader, bool required);

}  // namespace handsim::study
