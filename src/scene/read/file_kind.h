// Recognises the kind of a handsim file, so that a file in the wrong place gives one clear message.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "handsim/core/yaml_reader.h"

namespace handsim::scene {

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
  motion_names,
  marker_set
};

/// `a scene`, `a person`, ...
std::string_view described(FileKind kind);

/// The kind that a tree's keys indicate, if any.
std::optional<FileKind> kind_of(const YamlNode& root);

/// False, with a problem, for a tree that is empty, not a mapping, or of another kind than `wanted`.
bool is_of_kind(const YamlNode& root, const std::string& path, FileKind wanted, Diagnostics& diagnostics);

}  // namespace handsim::scene
