// Shares and rank correlations.
#include "handsim/study/rollouts/rollouts.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace handsim::study {
namespace {

struct Published {
  long held, of;
  double low, high;
};

// Oracle: Newcombe 1998 (Statistics in Medicine 17:857), table I, method 3.
TEST(Share, HasWilsonsIntervalAsPublished) {
  for (const Published& row : {Published{81, 263, 0.2553, 0.3662}, Published{15, 148, 0.0624, 0.1605},
                               Published{0, 20, 0, 0.1611}, Published{1, 29, 0.0061, 0.1718}}) {
    const auto estimate = share(row.held, row.of);
    ASSERT_TRUE(estimate);
    EXPECT_NEAR(estimate->low, row.low, 5e-5);
    EXPECT_NEAR(estimate->high, row.high, 5e-5);
    EXPECT_EQ(estimate->value, static_cast<double>(row.held) / static_cast<double>(row.of));
  }
  EXPECT_FALSE(share(0, 0));
  EXPECT_EQ(share(5, 5)->high, 1);
}

// Oracle: without ties 1 - 6 sum(d^2) / (n (n^2 - 1)).
TEST(RankCorrelation, IsItsClosedForm) {
  const std::vector<double> x = {1, 2, 3, 4, 5, 6}, y = {2, 1, 4, 3, 6, 5};
  EXPECT_NEAR(rank_correlation(x, y)->value, 1 - 6.0 * 6 / (6 * 35), 1e-15);
  const std::vector<double> grown = {std::exp(1), std::exp(2), std::exp(3),
                                     std::exp(4), std::exp(5), std::exp(6)};
  EXPECT_EQ(rank_correlation(x, grown)->value, 1);
}

// Oracle: with ties Pearson's correlation of mean ranks: of x = 1, 2, 3, 4 and a verdict 0, 0, 1, 1 these are
// 1.5, 1.5, 3.5, 3.5, which gives 4 / sqrt(5 * 4) = 0.894.
TEST(RankCorrelation, GivesTiesTheirMeanRank) {
  EXPECT_EQ(ranks(std::vector<double>{3, 1, 3, 2}), (std::vector<double>{3.5, 1, 3.5, 2}));
  const std::vector<double> x = {1, 2, 3, 4}, y = {0, 0, 1, 1};
  EXPECT_NEAR(rank_correlation(x, y)->value, 4 / std::sqrt(20.0), 1e-15);
}

// Oracle: a figure that does not vary has no rank correlation.
TEST(RankCorrelation, IsNothingWhereOneDoesNotVary) {
  EXPECT_FALSE(rank_correlation(std::vector<double>{1, 2, 3, 4}, std::vector<double>{1, 1, 1, 1}));
  EXPECT_FALSE(rank_correlation(std::vector<double>{1, 2, 3}, std::vector<double>{1, 0, 1}));
}

// Oracle: Fisher's z with Bonett and Wright's variance, written out: r = 0.5, n = 103 gives z = 0.549306 with
// a deviation of sqrt(1.125 / 100).
TEST(RankCorrelation, HasTheIntervalOfBonettAndWright) {
  std::vector<double> x, y;
  for (int i = 0; i < 103; ++i) x.push_back(i), y.push_back((i * 37) % 103);
  const auto estimate = rank_correlation(x, y);
  ASSERT_TRUE(estimate);
  const double r = estimate->value, half = 1.959963984540054 * std::sqrt((1 + r * r / 2) / 100);
  EXPECT_NEAR(std::atanh(estimate->high) - std::atanh(r), half, 1e-12);
  EXPECT_NEAR(std::atanh(r) - std::atanh(estimate->low), half, 1e-12);
}

}  // namespace
}  // namespace handsim::study
