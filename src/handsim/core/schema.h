// Makes the JSON Schema (draft 2020-12) of a kind of file by running its reader: the keys it asks for. Keys
// of one choice (`radius` of a sphere) stand with all others: only the reader checks what goes together.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "handsim/core/yaml_reader.h"

namespace handsim {

struct SchemaSource {
  std::string_view kind;  ///< as MapReader::file_or_block() calls it: `a person`
  /// Its reader; called many times, each time with more of the keys that it asked for.
  std::function<void(const YamlNode& root, Diagnostics& diagnostics)> read;
};

/// What a key means; empty if unknown. @param path dotted, without list indices: `objects.parts.radius`
using KeyText = std::function<std::string(std::string_view kind, std::string_view path)>;

/// @param sources of this kind and of all kinds of files that it refers to.
std::string json_schema(std::string_view kind, std::span<const SchemaSource> sources,
                        const KeyText& text_of = {});

}  // namespace handsim
