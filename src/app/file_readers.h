// The kinds of YAML file that have a reader of their own: `handsim check` reads them, `handsim schema`
// describes them.
#pragma once

#include <span>
#include <string_view>

#include "handsim/scene/read/file_kind.h"

namespace handsim::app {

struct FileReader {
  std::string_view word;  ///< of the command line
  scene::FileKind kind;
  void (*read)(YamlNode& root, Diagnostics& diagnostics);
};

std::span<const FileReader> file_readers();

}  // namespace handsim::app
