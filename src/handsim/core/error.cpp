#include "handsim/core/error.h"

#include <algorithm>
#include <tuple>

#include <fmt/format.h>

#include "handsim/core/text.h"
#include "handsim/core/yaml_reader.h"

namespace handsim {

namespace {

/// Enough for any key or list of words that handsim itself writes.
constexpr std::size_t kLongestPart = 1000;

std::string joined(const std::vector<Problem>& problems) {
  std::string text;
  for (const Problem& problem : problems) {
    if (!text.empty()) text += '\n';
    text += problem.text();
  }
  return text;
}

std::vector<Problem> capped(std::vector<Problem> problems) {
  if (problems.size() <= kMostProblems) return problems;
  const std::size_t more = problems.size() - kMostProblems;
  problems.resize(kMostProblems);
  problems.push_back({std::nullopt, "", fmt::format("{} more problems", more), "none"});
  return problems;
}

}  // namespace

std::string Place::text() const {
  return file.empty() ? "" : fmt::format("{}:{}:{}: ", printable(file, file.size()), line, column);
}

std::string Problem::text() const {
  std::string out = place ? place->text() : "";
  if (!key.empty()) out += printable(key, 200) + ": ";
  return out + fmt::format("got {}, need {}", printable(got, kLongestPart), printable(need, kLongestPart));
}

Error::Error(std::vector<Problem> problems, ErrorKind kind)
    : std::runtime_error(joined(capped(problems))), kind_(kind), problems_(capped(std::move(problems))) {}

Error::Error(PhysicsFault fault)
    : std::runtime_error(
          fmt::format("at t = {:.6g} s: {}: {}: {}", fault.time, fault.where, fault.quantity, fault.detail)),
      kind_(ErrorKind::physics),
      fault_(std::move(fault)) {}

Error input_error(std::string key, std::string got, std::string need) {
  return Error(std::vector<Problem>{{std::nullopt, std::move(key), std::move(got), std::move(need)}});
}

Error output_error(std::string key, std::string got, std::string need) {
  return Error(std::vector<Problem>{{std::nullopt, std::move(key), std::move(got), std::move(need)}},
               ErrorKind::output);
}

void Diagnostics::throw_if_any() const {
  if (problems.empty()) return;
  std::vector<std::string> files;
  // Sorts problems by file, in the order of reading, then by place.
  const auto rank = [&](const Problem& problem) {
    const Place place = problem.place.value_or(Place{"", 0, 0});
    auto at = std::ranges::find(files, place.file);
    if (at == files.end()) at = files.insert(files.end(), place.file);
    return std::tuple(at - files.begin(), place.line, place.column);
  };
  for (const Problem& problem : problems) rank(problem);
  std::vector<Problem> sorted = problems;
  std::ranges::stable_sort(sorted, [&](const Problem& a, const Problem& b) { return rank(a) < rank(b); });
  // A file that is read twice gives equal problems under two paths; after sorting, equal places are adjacent.
  const auto same = [](const Problem& a, const Problem& b) {
    const auto last = [](const std::string& key) { return key.substr(key.rfind('.') + 1); };
    return a.place && last(a.key) == last(b.key) && a.got == b.got;
  };
  std::vector<Problem> once;
  for (Problem& problem : sorted) {
    bool reported = false;
    for (auto other = once.rbegin(); other != once.rend() && rank(*other) == rank(problem); ++other)
      reported = reported || same(*other, problem);
    if (!reported) once.push_back(std::move(problem));
  }
  throw Error(std::move(once));
}

}  // namespace handsim
