// What readers of a scene's blocks share. All take problems into the reader's diagnostics and write defaults
// into the tree.
#pragma once

#include <optional>
#include <string>

#include "handsim/scene/read/file_kind.h"

namespace handsim::scene {

inline const Quantity kCoordinate = {Dimension::length, -1000, 1000};
inline const Quantity kVelocity = {Dimension::speed, -100, 100};
inline const Quantity kAngularVelocity = {Dimension::angular_speed, -1000, 1000};

/// `hands.0`.
std::string item_path(std::string_view list, std::size_t i);

/// `position` and `rotation`. @param fallback position where none is given; absent: it must be.
Pose read_pose(MapReader& reader, std::optional<Vec3> fallback = {});

/// A referenced file or an inline block; null where it is absent or, with a problem, cannot be read.
YamlNode* referenced(MapReader& reader, std::string_view key, FileKind kind, bool required = true);

/// Replaces the `file` of a block by the content of that file; keys that the block has itself win.
/// @param overridden true where the block's own keys take the place of the file's `key`. False, with
/// problems, where the file cannot be used.
bool inline_file(MapReader& block, FileKind kind,
                 bool (*overridden)(const YamlNode& entry, const std::string& key));

}  // namespace handsim::scene
