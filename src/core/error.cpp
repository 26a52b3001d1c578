#include "handsim/core/error.h"

#include "handsim/core/text.h"

#include <fmt/format.h>

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

}  // namespace handsim
