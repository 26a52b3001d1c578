#include <algorithm>
#include <tuple>

#include "handsim/core/yaml_reader.h"

namespace handsim {

void Diagnostics::throw_if_any() const {
  if (problems.empty()) return;
  std::vector<std::string> files;
  // Sorts problems by file, in the order of reading, then by place.
  const auto rank = [&](const Problem& problem) {
    const Place place = problem.place.value_or(Place{"", 0, 0});
    auto at = std::find(files.begin(), files.end(), place.file);
    if (at == files.end()) at = files.insert(files.end(), place.file);
    return std::tuple(at - files.begin(), place.line, place.column);
  };
  for (const Problem& problem : problems) rank(problem);
  std::vector<Problem> sorted = problems;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [&](const Problem& a, const Problem& b) { return rank(a) < rank(b); });
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
