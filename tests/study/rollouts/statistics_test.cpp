// Shares, rank correlations and shares of variance.
#include "handsim/study/statistics.h"

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

/// A lattice in the cube from -1 to 1, by the golden numbers of Roberts.
std::vector<Input> lattice(std::size_t rows) {
  std::vector<Input> out = {{"a", {}}, {"b", {}}, {"c", {}}};
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t k = 0; k < 3; ++k)
      out[k].values.push_back(
          2 * std::fmod(static_cast<double>(i + 1) / std::pow(1.22074408460575947536, k + 1), 1.0) - 1);
  return out;
}

double share_of(const std::vector<VarianceShare>& shares, const std::string& of) {
  for (const VarianceShare& each : shares)
    if (each.of == of) return each.share;
  return NAN;
}

// Oracle: Sobol's indices in closed form. For a, b, c even from -1 to 1 the variances of 3a, 2ab and 4c^2 are
// 3, 4/9 and 64/45; c^2 is an inverted U without rank correlation.
TEST(VarianceShares, AreSobolsIndicesOfIndependentInputs) {
  std::vector<Input> inputs = lattice(5000);
  std::vector<double> y;
  for (std::size_t i = 0; i < 5000; ++i) {
    const double a = inputs[0].values[i], b = inputs[1].values[i], c = inputs[2].values[i];
    y.push_back(3 * a + 2 * a * b - 4 * c * c);
    // Ranks do not see the scale.
    inputs[0].values[i] = std::exp(a);
  }
  const std::vector<VarianceShare> shares = variance_shares(inputs, y);
  const double all = 3 + 4.0 / 9 + 64.0 / 45;
  EXPECT_EQ(shares.front().of, "a");
  EXPECT_NEAR(share_of(shares, "a"), 3 / all, 2e-3);
  EXPECT_NEAR(share_of(shares, "c"), 64.0 / 45 / all, 2e-3);
  EXPECT_NEAR(share_of(shares, "a x b"), 4.0 / 9 / all, 2e-3);
  EXPECT_NEAR(share_of(shares, "b"), 0, 2e-3);
  EXPECT_NEAR(share_of(shares, "b x c"), 0, 2e-3);
  EXPECT_NEAR(rank_correlation(inputs[2].values, y)->value, 0, 0.03);
}

// Oracle: of categories the share is that between their means (eta squared); of an outcome that depends on
// nothing, no share is above what chance leaves.
TEST(VarianceShares, OfCategoriesAndOfNothing) {
  std::vector<Input> inputs = lattice(3000);
  inputs.push_back({"kind", {}, true});
  std::vector<double> y, noise;
  for (std::size_t i = 0; i < 3000; ++i) {
    inputs[3].values.push_back(static_cast<double>(i % 3));
    noise.push_back(std::fmod(static_cast<double>(i + 1) * 0.7548776662466927, 1.0));
    // Means 0, 1 and 5: variance 14/3. The noise has 1/12 on 4 times its range.
    y.push_back((i % 3 == 2 ? 5.0 : static_cast<double>(i % 3)) + 4 * noise.back());
  }
  EXPECT_NEAR(share_of(variance_shares(inputs, y), "kind"), 14.0 / 3 / (14.0 / 3 + 16.0 / 12), 5e-3);
  double sum = 0;
  for (const VarianceShare& each : variance_shares(inputs, noise)) sum += each.share;
  EXPECT_NEAR(sum, 0, 0.01);
  EXPECT_TRUE(variance_shares(inputs, std::vector<double>(3000, 1)).empty());
}

}  // namespace
}  // namespace handsim::study
