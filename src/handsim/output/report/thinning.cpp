#include "handsim/output/report/thinning.h"

#include <algorithm>
#include <limits>

namespace handsim::output {

namespace {

/// Narrows the slopes of each column by one row; false if the row's own slope is not among them.
class Door {
 public:
  Door(std::span<const float> values, std::span<const double> tolerances)
      : values_(values), tolerances_(tolerances), low_(tolerances.size()), high_(tolerances.size()) {}

  void open(std::size_t row) {
    from_ = row;
    low_.assign(low_.size(), -std::numeric_limits<double>::infinity());
    high_.assign(high_.size(), std::numeric_limits<double>::infinity());
  }
  bool pass(std::size_t row, double span) {
    const std::size_t n = tolerances_.size();
    bool good = true;
    for (std::size_t c = 0; c < n; ++c) {
      const double rise = static_cast<double>(values_[row * n + c]) - values_[from_ * n + c];
      good = good && rise >= low_[c] * span && rise <= high_[c] * span;
      low_[c] = std::max(low_[c], (rise - tolerances_[c]) / span);
      high_[c] = std::min(high_[c], (rise + tolerances_[c]) / span);
    }
    return good;
  }

 private:
  std::span<const float> values_;
  std::span<const double> tolerances_;
  std::vector<double> low_, high_;
  std::size_t from_ = 0;
};

}  // namespace

std::vector<std::size_t> kept_rows(std::span<const double> times, std::span<const float> values,
                                   std::span<const double> tolerances) {
  std::vector<std::size_t> kept;
  if (times.empty()) return kept;
  Door door(values, tolerances);
  kept.push_back(0);
  door.open(0);
  for (std::size_t row = 1; row < times.size(); ++row) {
    if (door.pass(row, times[row] - times[kept.back()])) continue;
    // A row that follows directly always passes, so the one before is a later one than the last kept.
    kept.push_back(row - 1);
    door.open(row - 1);
    door.pass(row, times[row] - times[row - 1]);
  }
  if (times.size() > 1) kept.push_back(times.size() - 1);
  return kept;
}

Thinned thinned(std::span<const double> times, std::span<const float> values, std::vector<double> tolerances,
                std::size_t most) {
  Thinned out;
  for (;; out.factor *= 2) {
    out.rows = kept_rows(times, values, tolerances);
    if (out.rows.size() <= most || out.rows.size() <= 2) return out;
    for (double& tolerance : tolerances) tolerance *= 2;
  }
}

}  // namespace handsim::output
