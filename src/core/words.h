// Messages about words of which only some are known.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace handsim {

/// `a`, or `one of a, b`.
std::string list_of(const std::vector<std::string>& words);

/// What is needed in place of a word that is none of those known: `one of a, b (nearest: b)`.
std::string need_word(std::string_view got, const std::vector<std::string>& known);

/// ` (nearest: b)`, or nothing where none is near enough to be meant.
std::string nearest_hint(std::string_view got, const std::vector<std::string>& known);

/// The word of `known` nearest to `word`, if any is near enough to be meant.
std::optional<std::string> nearest_word(std::string_view word, const std::vector<std::string>& known);

}  // namespace handsim
