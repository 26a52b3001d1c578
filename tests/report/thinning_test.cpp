// Oracle: the definition of the tolerance, checked for every dropped row.
#include "handsim/output/report/thinning.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace handsim::output {
namespace {

/// Largest distance of a dropped row from the line between the kept rows around it, over the tolerance.
double worst(const std::vector<double>& times, const std::vector<float>& values,
             const std::vector<double>& tolerances, const std::vector<std::size_t>& kept) {
  const std::size_t n = tolerances.size();
  double out = 0;
  for (std::size_t k = 0; k + 1 < kept.size(); ++k)
    for (std::size_t row = kept[k]; row <= kept[k + 1]; ++row)
      for (std::size_t c = 0; c < n; ++c) {
        const double a = values[kept[k] * n + c], b = values[kept[k + 1] * n + c];
        const double share = (times[row] - times[kept[k]]) / (times[kept[k + 1]] - times[kept[k]]);
        out = std::max(out, std::abs(a + share * (b - a) - values[row * n + c]) / tolerances[c]);
      }
  return out;
}

TEST(Thinning, EveryDroppedRowIsWithinTheTolerance) {
  std::mt19937 random(7);
  std::normal_distribution<float> step(0, 1);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<double> times;
    std::vector<float> values = {0, 0, 0};
    double time = 0;
    for (int row = 0; row < 500; ++row) {
      times.push_back(time += 0.5 + std::abs(step(random)));
      if (row > 0)
        for (int c = 0; c < 3; ++c) values.push_back(values[values.size() - 3] + step(random));
    }
    const std::vector<double> tolerances = {2, 5, 3};
    const auto kept = kept_rows(times, values, tolerances);
    EXPECT_LE(worst(times, values, tolerances, kept), 1 + 1e-6);
    EXPECT_LT(kept.size(), 450U);
    EXPECT_EQ(kept.front(), 0U);
    EXPECT_EQ(kept.back(), 499U);
  }
}

TEST(Thinning, OfAStraightMotionTwoRowsAreKept) {
  std::vector<double> times;
  std::vector<float> values;
  for (int row = 0; row < 1000; ++row) {
    times.push_back(0.001 * row);
    values.push_back(0.25F * static_cast<float>(row));
  }
  EXPECT_EQ(kept_rows(times, values, std::vector{1e-3}), (std::vector<std::size_t>{0, 999}));
}

TEST(Thinning, AJumpIsKeptOnBothSides) {
  const std::vector<double> times = {0, 1, 2, 3, 4, 5};
  const std::vector<float> values = {0, 0, 0, 1, 1, 1};
  EXPECT_EQ(kept_rows(times, values, std::vector{1e-3}), (std::vector<std::size_t>{0, 2, 3, 5}));
}

// A minute at 1 ms: a hand of 20 bodies moves for two seconds and rests.
TEST(Thinning, AMinuteOfRowsBecomesWhatAPageCanHold) {
  std::vector<double> times;
  std::vector<float> values;
  constexpr int kColumns = 140;
  for (int row = 0; row <= 60'000; ++row) {
    times.push_back(0.001 * row);
    const double phase = std::min(times.back(), 2.0);
    for (int c = 0; c < kColumns; ++c) values.push_back(static_cast<float>(0.1 * std::sin(3 * phase + c)));
  }
  const std::vector<double> tolerances(kColumns, 5e-5);
  const Thinned thin = thinned(times, values, tolerances, 1500);
  EXPECT_EQ(thin.factor, 1);
  EXPECT_LT(thin.rows.size(), 200U);
  EXPECT_LE(worst(times, values, tolerances, thin.rows), 1 + 1e-6);
}

TEST(Thinning, NoiseBeyondTheBudgetWidensTheToleranceAndSaysSo) {
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0, 1);
  std::vector<double> times;
  std::vector<float> values;
  for (int row = 0; row < 4000; ++row) {
    times.push_back(row);
    values.push_back(noise(random));
  }
  const Thinned thin = thinned(times, values, {1e-3}, 300);
  EXPECT_LE(thin.rows.size(), 300U);
  EXPECT_GT(thin.factor, 1);
  EXPECT_LE(worst(times, values, {1e-3 * thin.factor}, thin.rows), 1 + 1e-6);
}

}  // namespace
}  // namespace handsim::output
