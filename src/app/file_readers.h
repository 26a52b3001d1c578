// Table of the readers of YAML files, for `handsim check` and `handsim schema`.
#pragma once

#include <span>
#include <string_view>

#include "handsim/scene/read/blocks.h"

namespace handsim::app {

struct FileReader {
  std::string_view word;  ///< of the command line
  scene::FileKind kind;
  void (*read)(YamlNode& root, Diagnostics& diagnostics);
};

std::span<const FileReader> file_readers();

}  // namespace handsim::app
