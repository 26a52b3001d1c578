// What the keys of files mean: rows of the tables of docs/, which are part of the program.
#pragma once

#include <string>
#include <string_view>

namespace handsim::app {

/// The meaning of a key, as a page says it; empty if none does.
/// A table of keys follows a line `<!-- keys: scene objects; scene bodies -->`: kinds of files, each with the
/// path of the block that has the keys; `*` is any kind. A block without a row for a key has that of the
/// longest path at its end.
/// @param kind word of a FileReader  @param path dotted, without list indices
std::string key_text(std::string_view kind, std::string_view path);

}  // namespace handsim::app
