// Functions for the readers of study files; private to this folder.
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
/// The value as YAML in one line (flow style).
std::string flow_text(const YamlNode& node);
/// The path of a scene file, given relative to the node's own file; nothing, and a problem, if there is none.
std::optional<std::filesystem::path> scene_path(const YamlNode& node, const std::string& key,
                                                Diagnostics& diagnostics);
std::optional<std::filesystem::path> read_scene_path(MapReader& reader, bool required);

}  // namespace handsim::study
