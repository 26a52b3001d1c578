// Input files of a run other than YAML: meshes and motion files. A resolved scene refers to copies of them,
// so that it is self-contained. This module names the copies and writes the text of the resolved scene.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "handsim/core/yaml.h"

namespace handsim::scene {

/// A file that a scene reads, as it was when the scene was read.
struct ReferencedFile {
  std::filesystem::path path;  ///< absolute path of the original
  std::string copy;            ///< path of the copy, relative to the resolved scene: `inputs/wave.mot`
  std::shared_ptr<const std::string> bytes;  ///< its content
};

/// The files by absolute paths, each once; those of equal names in several folders get a number.
/// @throws Error (input) if one cannot be read.
std::vector<ReferencedFile> collect_inputs(const std::vector<std::filesystem::path>& files);

/// The scene with the paths of the copies in place of the originals: the content of resolved.yaml.
YamlNode standalone(YamlNode resolved, const std::vector<ReferencedFile>& inputs);

/// The text of standalone(). @throws Error (input) if it exceeds the limits of the reader.
std::string standalone_text(const YamlNode& resolved, const std::vector<ReferencedFile>& inputs);

/// The copies that an earlier run's resolved scene names, relative to it; none if there is no such scene.
std::vector<std::string> copies_named_in(const std::filesystem::path& resolved);

}  // namespace handsim::scene
