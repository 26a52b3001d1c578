// What a run reads that YAML does not hold: meshes and motion files. A resolved scene names copies of them,
// so that it stands alone; here are the copies' names and bytes, and the resolved scene's text.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "handsim/core/yaml.h"

namespace handsim::scene {

/// A file that a scene reads, as it was when the scene was read.
struct InputFile {
  std::filesystem::path path;  ///< where it was read, absolute
  std::string copy;            ///< where the resolved scene has it, relative to itself: `inputs/wave.mot`
  std::shared_ptr<const std::string> bytes;  ///< its content
};

/// The meshes and motion files that a resolved scene names by absolute paths, each once, in the order of the
/// scene; files of one name in several folders get a number. @throws Error (input) where one cannot be read.
std::vector<InputFile> collect_inputs(YamlNode& resolved);

/// The scene with its files' copies in place of the files: the content of resolved.yaml.
YamlNode standalone(YamlNode resolved, const std::vector<InputFile>& inputs);

/// Its text. @throws Error (input) where it is more than the reader takes.
std::string standalone_text(const YamlNode& resolved, const std::vector<InputFile>& inputs);

/// The copies that the resolved scene of an earlier run names, relative to it; none where the file is missing
/// or no such scene.
std::vector<std::string> copies_named_in(const std::filesystem::path& resolved);

}  // namespace handsim::scene
