// Statistics of studies: intervals, rank correlation, and which inputs own an outcome's variance.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

namespace handsim::study {

/// A figure with its 95 % interval.
struct Estimate {
  double value = 0, low = 0, high = 0;
};

/// A share with Wilson's interval (1927); nothing of none.
std::optional<Estimate> share(long held, long of);

/// A mean with the normal interval of its standard error; nothing of none.
std::optional<Estimate> mean_of(std::span<const double> values);

/// The value below which a share of the sorted values lies, linear between neighbours.
double quantile(std::span<const double> sorted, double share);

/// Spearman's rank correlation, ties with their mean rank, and its interval by Fisher's z with the variance
/// of Bonett and Wright (2000). Nothing of fewer than four pairs, or where one of the two does not vary.
std::optional<Estimate> rank_correlation(std::span<const double> x, std::span<const double> y);

/// Ranks from 1; equal values share their mean rank.
std::vector<double> ranks(std::span<const double> values);

/// An input of a study: numbers, or indices of categories.
struct Input {
  std::string name;
  std::vector<double> values;
  bool categories = false;
};

/// The share of an outcome's variance that an input, or a pair as `a x b`, explains.
struct VarianceShare {
  std::string of;
  double share = 0;
};

/// Least squares of y on Legendre's polynomials of the inputs' ranks to degree 3 (lower with few rows) and
/// products of the first ones; a term's share is its covariance with y (Li et al. 2010, J Phys Chem A
/// 114:6022), less what chance gives. Of independent inputs these are Sobol's indices. Pairs only with ten
/// rows for each term.
/// @return the largest first; nothing where y does not vary or rows are too few.
std::vector<VarianceShare> variance_shares(const std::vector<Input>& inputs, std::span<const double> y);

/// The three largest of at least 1 %, and how much all explain: `a 60 %, b 20 % (85 % explained)`.
std::string owners_text(const std::vector<VarianceShare>& shares);

}  // namespace handsim::study
