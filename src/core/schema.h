// JSON Schema (draft 2020-12) of a kind of file, found by running its reader: whatever the reader asks for is
// in the schema, and nothing else. Keys that a value brings in (`radius` of a sphere) stand beside all
// others, and are required only where every choice requires them: the reader judges how keys go together.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "handsim/core/yaml_reader.h"

namespace handsim {

/// A kind of file.
struct SchemaSource {
  std::string_view kind;  ///< as MapReader::file_or_block() calls it: `a person`
  /// Its reader; called many times, with trees that grow by what it asks for.
  std::function<void(YamlNode& root, Diagnostics& diagnostics)> read;
};

/// @param sources of this kind and of those that its files name.
std::string json_schema(std::string_view kind, std::span<const SchemaSource> sources);

}  // namespace handsim
