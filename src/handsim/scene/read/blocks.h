// Helpers of the readers of a scene's blocks. Problems and defaults go into the diagnostics.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "handsim/core/yaml_reader.h"

namespace handsim::scene {

/// The kind of a handsim file, recognised so that a file in the wrong place gives one clear message.
enum class FileKind {
  scene,
  person,
  hand_model,
  anthropometry,
  controller,
  poses,
  study,
  stability,
  object,
  grip_norms,
  material,
  costs,
  rollouts,
  muscles,
  measurements,
  motion_names,
  marker_set
};

/// `a scene`, `a person`, ...
std::string_view described(FileKind kind);

/// The kind that a tree's keys indicate, if any.
std::optional<FileKind> kind_of(const YamlNode& root);

/// False, with a problem, for a tree that is empty, not a mapping, or of another kind than `wanted`.
bool is_of_kind(const YamlNode& root, const std::string& path, FileKind wanted, Diagnostics& diagnostics);

inline const Quantity kCoordinate = {Dimension::length, -1000, 1000};
inline const Quantity kVelocity = {Dimension::speed, -100, 100};
inline const Quantity kAngularVelocity = {Dimension::angular_speed, -1000, 1000};

/// `hands.0`.
std::string item_path(std::string_view list, std::size_t i);

/// Reads `position` and `rotation`. @param fallback default position; without it the position is required.
Pose read_pose(MapReader& reader, std::optional<Vec3> fallback = {});

/// A referenced file or an inline block; null if it is absent, or cannot be read, which is a problem.
/// @param otherwise file of an absent key
const YamlNode* referenced(MapReader& reader, std::string_view key, FileKind kind, bool required = true,
                           const std::string& otherwise = {});

/// Reads the content of a block's `file` under the block's own keys. @param overridden true
/// if these replace the file's `key`. @returns false, with problems, if the file cannot be used
bool inline_file(MapReader& block, FileKind kind,
                 bool (*overridden)(const YamlNode& entry, const std::string& key));

}  // namespace handsim::scene
