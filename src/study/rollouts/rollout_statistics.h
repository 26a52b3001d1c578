// Shares and rank correlations with their 95 % intervals.
#pragma once

#include <optional>
#include <span>
#include <vector>

namespace handsim::study {

/// A figure with its 95 % interval.
struct Estimate {
  double value = 0, low = 0, high = 0;
};

/// A share with Wilson's interval (1927); nothing of none.
std::optional<Estimate> share(long held, long of);

/// Spearman's rank correlation, ties with their mean rank, and its interval by Fisher's z with the variance
/// of Bonett and Wright (2000). Nothing of fewer than four pairs, or where one of the two does not vary.
std::optional<Estimate> rank_correlation(std::span<const double> x, std::span<const double> y);

/// Ranks from 1; equal values share their mean rank.
std::vector<double> ranks(std::span<const double> values);

}  // namespace handsim::study
