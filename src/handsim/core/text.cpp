#include "handsim/core/text.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace handsim {

namespace {

bool is_control(unsigned char c) { return c < 0x20 || c == 0x7f; }
bool is_continuation(unsigned char c) { return (c & 0xc0U) == 0x80; }

struct Character {
  std::size_t size = 0;    ///< [bytes]
  unsigned long code = 0;  ///< Unicode code point
};

/// The UTF-8 character of more than one byte at the start of the text.
std::optional<Character> decode(std::string_view text) {
  struct Form {
    unsigned char mask, lead;
    std::size_t size;
    unsigned long least;  ///< smaller code points have a shorter form
  };
  constexpr std::array<Form, 3> kForms = {
      {{0xe0, 0xc0, 2, 0x80}, {0xf0, 0xe0, 3, 0x800}, {0xf8, 0xf0, 4, 0x10000}}};
  const auto first = static_cast<unsigned char>(text.front());
  for (const Form& form : kForms) {
    if ((first & form.mask) != form.lead) continue;
    if (text.size() < form.size) return std::nullopt;
    unsigned long code = first & static_cast<unsigned char>(~form.mask);
    for (const char c : text.substr(1, form.size - 1)) {
      if (!is_continuation(static_cast<unsigned char>(c))) return std::nullopt;
      code = (code << 6U) | (static_cast<unsigned char>(c) & 0x3fU);
    }
    const bool surrogate = code >= 0xd800 && code <= 0xdfff;
    if (code < form.least || code > 0x10ffff || surrogate) return std::nullopt;
    return Character{form.size, code};
  }
  return std::nullopt;
}

/// Unicode noncharacters, which YAML forbids.
bool is_noncharacter(unsigned long code) {
  return (code & 0xfffeU) == 0xfffe || (code >= 0xfdd0 && code <= 0xfdef);
}

/// C1 control characters: terminals execute them. U+0085 is a line end.
bool is_c1_control(unsigned long code) { return code >= 0x80 && code <= 0x9f; }

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

/// Words of other programs, and the words here that mean the same.
constexpr std::string_view kMeanings =
    " diameter=radius weight=mass height=stature gender=sex handedness=side size=edges dimensions=edges "
    "colour=color type=shape pos=position location=position orientation=rotation quaternion=rotation "
    "fixed=static mu=friction elasticity=restitution bounce=restitution dt=step timestep=step time_step=step "
    "end_time=duration t_end=duration limits=range limit=range kp=proportional stiffness=proportional "
    "kd=derivative damping=derivative ki=integral max_torque=torque_limit ";

/// The word of `known` with the same meaning.
std::optional<std::string> same_meaning(std::string_view word, const std::vector<std::string>& known) {
  if (word.size() > 16) return std::nullopt;
  const std::string other = " " + lower_case(word) + "=";
  const std::size_t at = kMeanings.find(other);
  if (at == std::string_view::npos) return std::nullopt;
  const std::string_view rest = kMeanings.substr(at + other.size());
  const auto found = std::ranges::find(known, rest.substr(0, rest.find(' ')));
  return found == known.end() ? std::nullopt : std::optional(*found);
}

}  // namespace

std::optional<BadByte> find_bad_byte(std::string_view text) {
  for (std::size_t at = 0; at < text.size();) {
    const auto c = static_cast<unsigned char>(text[at]);
    if (is_control(c) && c != '\t' && c != '\n' && c != '\r')
      return BadByte{at, fmt::format("the control character 0x{:02x}", c)};
    if (c < 0x80) {
      ++at;
      continue;
    }
    const std::optional<Character> found = decode(text.substr(at));
    if (!found) return BadByte{at, fmt::format("the byte 0x{:02x}, which is not UTF-8", c)};
    if (is_noncharacter(found->code))
      return BadByte{at, fmt::format("U+{:04X}, which is not a character", found->code)};
    if (is_c1_control(found->code) && found->code != 0x85)
      return BadByte{at, fmt::format("the control character U+{:04X}", found->code)};
    at += found->size;
  }
  return std::nullopt;
}

std::string printable(std::string_view text, std::size_t limit) {
  const bool cut = text.size() > limit;
  if (cut) {
    while (limit > 0 && is_continuation(static_cast<unsigned char>(text[limit]))) --limit;
    text = text.substr(0, limit);
  }
  std::string out;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    if (c == '\xc2' && at + 1 < text.size() && is_c1_control(static_cast<unsigned char>(text[at + 1])))
      out += fmt::format("\\x{:02x}", static_cast<unsigned char>(text[++at]));
    else if (c == '\n')
      out += "\\n";
    else if (c == '\t')
      out += "\\t";
    else if (is_control(static_cast<unsigned char>(c)))
      out += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
    else
      out += c;
  }
  return cut ? out + "..." : out;
}

std::string_view trimmed(std::string_view text) {
  const std::size_t first = std::min(text.find_first_not_of(" \t\r"), text.size());
  return text.substr(first, text.find_last_not_of(" \t\r") + 1 - first);
}

std::vector<std::string_view> split(std::string_view line, char separator) {
  std::vector<std::string_view> out;
  while (true) {
    const std::size_t end = line.find(separator);
    out.push_back(trimmed(line.substr(0, end)));
    if (end == std::string_view::npos) return out;
    line.remove_prefix(end + 1);
  }
}

std::string_view take_line(std::string_view& text) {
  const std::size_t end = std::min(text.find('\n'), text.size());
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  return line;
}

std::string lower_case(std::string_view text) {
  std::string out(text);
  for (char& c : out)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return out;
}

std::string list_of(const std::vector<std::string>& words) {
  return words.size() == 1 ? words.front() : "one of " + fmt::format("{}", fmt::join(words, ", "));
}

std::string nearest_hint(std::string_view got, const std::vector<std::string>& known) {
  const std::optional<std::string> near = nearest_word(got, known);
  const bool half = near == "radius" && lower_case(got) == "diameter";
  return near ? fmt::format(" (nearest: {}{})", *near, half ? ", half of it" : "") : "";
}

std::string need_word(std::string_view got, const std::vector<std::string>& known) {
  return list_of(known) + nearest_hint(got, known);
}

std::optional<std::string> nearest_word(std::string_view word, const std::vector<std::string>& known) {
  if (auto meant = same_meaning(word, known)) return meant;
  std::optional<std::string> best;
  std::size_t best_distance = std::clamp<std::size_t>(word.size() / 3, word.size() < 4 ? 1 : 2, 3) + 1;
  for (const std::string& candidate : known) {
    // The distance is at least the difference in length; this also skips words of megabytes.
    if (word.size() >= candidate.size() + best_distance) continue;
    const std::size_t distance = edit_distance(lower_case(word), lower_case(candidate));
    if (distance < best_distance) {
      best_distance = distance;
      best = candidate;
    }
  }
  return best;
}

}  // namespace handsim
