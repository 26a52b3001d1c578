#include "handsim/study/rollouts/rollout_statistics.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace handsim::study {

namespace {

constexpr double kNormal95 = 1.959963984540054;  ///< quantile 0.975 of the standard normal distribution

}  // namespace

std::optional<Estimate> share(long held, long of) {
  if (of <= 0) return std::nullopt;
  const auto n = static_cast<double>(of);
  const double p = static_cast<double>(held) / n, zz = kNormal95 * kNormal95;
  const double centre = (p + zz / (2 * n)) / (1 + zz / n);
  const double half = kNormal95 / (1 + zz / n) * std::sqrt(p * (1 - p) / n + zz / (4 * n * n));
  // The ends are 0 and 1 where none and all are held; rounding must not say otherwise.
  return Estimate{p, held == 0 ? 0 : centre - half, held == of ? 1 : centre + half};
}

std::vector<double> ranks(std::span<const double> values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  std::vector<double> out(values.size());
  for (std::size_t from = 0, to = 0; from < order.size(); from = to) {
    while (to < order.size() && values[order[to]] == values[order[from]]) ++to;
    for (std::size_t i = from; i < to; ++i) out[order[i]] = 0.5 * static_cast<double>(from + 1 + to);
  }
  return out;
}

std::optional<Estimate> rank_correlation(std::span<const double> x, std::span<const double> y) {
  if (x.size() < 4 || x.size() != y.size()) return std::nullopt;
  const std::vector<double> a = ranks(x), b = ranks(y);
  const auto n = static_cast<double>(a.size());
  const double mean = 0.5 * (n + 1);
  double ab = 0, aa = 0, bb = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    ab += (a[i] - mean) * (b[i] - mean);
    aa += (a[i] - mean) * (a[i] - mean);
    bb += (b[i] - mean) * (b[i] - mean);
  }
  if (aa == 0 || bb == 0) return std::nullopt;
  const double r = std::clamp(ab / std::sqrt(aa * bb), -1.0, 1.0);
  if (std::abs(r) == 1) return Estimate{r, r, r};
  const double z = std::atanh(r), half = kNormal95 * std::sqrt((1 + 0.5 * r * r) / (n - 3));
  return Estimate{r, std::tanh(z - half), std::tanh(z + half)};
}

}  // namespace handsim::study
