// Checks UTF-8, escapes control characters in messages, and finds the known word nearest to an unknown one.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace handsim {

/// The first byte that is not valid text, and why.
struct BadByte {
  std::size_t at = 0;
  std::string what;  ///< e.g. `the byte 0xff, which is not UTF-8`
};

/// First byte of no valid UTF-8 (RFC 3629), or starts a noncharacter or control character, not \t, \n, \r.
std::optional<BadByte> find_bad_byte(std::string_view text);

/// The text on one line: control characters as `\n`, `\t` or `\x1b`; at most `limit` bytes, whole characters.
std::string printable(std::string_view text, std::size_t limit = 60);

/// Removes the first line from a text that is not empty; returns it without its line end.
std::string_view take_line(std::string_view& text);

/// Without blanks, tabs and carriage returns at both ends.
std::string_view trimmed(std::string_view text);
/// The parts of a line between separators, trimmed.
std::vector<std::string_view> split(std::string_view line, char separator);

/// Letters A to Z as a to z.
std::string lower_case(std::string_view text);

/// `a`, or `one of a, b`.
std::string list_of(const std::vector<std::string>& words);

/// The known words for a message about an unknown one: `one of a, b (nearest: b)`.
std::string need_word(std::string_view got, const std::vector<std::string>& known);

/// ` (nearest: b)`, or an empty text if nearest_word() finds none.
std::string nearest_hint(std::string_view got, const std::vector<std::string>& known);

/// The word of `known` nearest to `word`: of one meaning (mass for weight), or with 1 to 3 other letters.
std::optional<std::string> nearest_word(std::string_view word, const std::vector<std::string>& known);

}  // namespace handsim
