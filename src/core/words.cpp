#include "handsim/core/words.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/text.h"

namespace handsim {

namespace {

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
    "colour=color "
    "type=shape pos=position location=position orientation=rotation quaternion=rotation fixed=static "
    "mu=friction "
    "elasticity=restitution bounce=restitution dt=step timestep=step time_step=step end_time=duration "
    "t_end=duration "
    "limits=range limit=range kp=proportional stiffness=proportional kd=derivative damping=derivative "
    "ki=integral "
    "max_torque=torque_limit ";

/// The word of `known` with the same meaning.
std::optional<std::string> same_meaning(std::string_view word, const std::vector<std::string>& known) {
  if (word.size() > 16) return std::nullopt;
  const std::string other = " " + lower_case(word) + "=";
  const std::size_t at = kMeanings.find(other);
  if (at == std::string_view::npos) return std::nullopt;
  const std::string_view rest = kMeanings.substr(at + other.size());
  const auto found = std::find(known.begin(), known.end(), rest.substr(0, rest.find(' ')));
  return found == known.end() ? std::nullopt : std::optional(*found);
}

}  // namespace

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
