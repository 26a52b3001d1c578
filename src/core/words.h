// Messages that list the known words and the one nearest to an unknown word.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace handsim {

/// `a`, or `one of a, b`.
std::string list_of(const std::vector<std::string>& words);

/// The known words for a message about an unknown one: `one of a, b (nearest: b)`.
std::string need_word(std::string_view got, const std::vector<std::string>& known);

/// ` (nearest: b)`, or an empty text if nearest_word() finds none.
std::string nearest_hint(std::string_view got, const std::vector<std::string>& known);

/// The word of `known` nearest to `word`: of the same meaning (mass for weight), or with at most 1 to 3 other
/// letters (more for longer words).
std::optional<std::string> nearest_word(std::string_view word, const std::vector<std::string>& known);

}  // namespace handsim
