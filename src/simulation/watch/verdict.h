// A criterion's figure beside its limit.
#pragma once

#include <optional>
#include <string>

namespace handsim::simulation {

struct Verdict {
  std::string name;
  std::string unit;
  std::optional<double> measured = 0;  ///< absent: the run had nothing to measure, e.g. no hold of a pose
  std::optional<double> limit;         ///< absent: measured, not judged
  double time = 0;                     ///< of the figure [s]
  std::string where;                   ///< joint or body of the figure
  bool least = false;                  ///< the limit is the least that will do, not the most

  /// A criterion without a measured value is not held.
  bool held() const { return !limit || (measured && (least ? *measured >= *limit : *measured <= *limit)); }
  bool missed() const { return limit && !measured; }  ///< the run did not come to what is judged
  bool failed() const { return !held() && !missed(); }
};

}  // namespace handsim::simulation
