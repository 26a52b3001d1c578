// Which of handsim's kinds of file a YAML tree is, so that one file in another's place is one clear message.
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
  rollouts
};

/// `a scene`, `a person`, ...
std::string_view described(FileKind kind);

/// The kind that a tree's keys show, if they show one.
std::optional<FileKind> kind_of(const YamlNode& root);

/// False, with a problem, for a tree that is empty, no mapping, or plainly of another kind than `wanted`.
bool is_of_kind(const YamlNode& root, const std::string& path, FileKind wanted, Diagnostics& diagnostics);

}  // namespace handsim::scene
