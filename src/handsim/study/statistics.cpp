#include "handsim/study/statistics.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/index.h"
#include "handsim/core/least_squares.h"

namespace handsim::study {

namespace {

/// A text with more terms, one less than its values, is left out where variance is split.
constexpr std::size_t kMostCategories = 50;
constexpr double kNormal95 = 1.959963984540054;  ///< quantile 0.975 of the standard normal distribution

Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }

/// Terms of the regression that belong together: those of one input, or one product.
struct Group {
  std::string of;
  Eigen::Index first = 0, count = 0;
};

/// An input's ranks from -1 to 1, or its categories.
struct Basis {
  const Input* input = nullptr;
  std::vector<double> u;
  std::size_t terms = 0;

  double first(std::size_t row) const { return std::sqrt(3) * u[row]; }
  void write(std::size_t row, Eigen::Ref<Eigen::VectorXd> out) const {
    const double x = u[row];
    const double legendre[] = {first(row), std::sqrt(5) / 2 * (3 * x * x - 1),
                               std::sqrt(7) / 2 * (5 * x * x - 3) * x};
    for (std::size_t i = 0; i < terms; ++i)
      out[index(i)] = input->categories ? static_cast<double>(x == static_cast<double>(i)) : legendre[i];
  }
};

Basis basis_of(const Input& input, std::size_t degree) {
  const std::size_t values = std::set<double>(input.values.begin(), input.values.end()).size();
  Basis out{&input, input.values, values - 1};
  if (input.categories) return out;
  out.terms = std::min(degree, values - 1);
  out.u = ranks(input.values);
  for (double& u : out.u) u = (2 * u - 1) / static_cast<double>(out.u.size()) - 1;
  return out;
}

/// The regression's terms: of each input, and of each pair of numbers where the rows are enough.
class Terms {
 public:
  Terms(const std::vector<Input>& inputs, std::size_t rows, std::size_t degree) {
    for (const Input& input : inputs) {
      Basis basis = basis_of(input, degree);
      if (basis.terms == 0 || basis.terms > kMostCategories) continue;
      add(input.name, basis.terms);
      bases_.push_back(std::move(basis));
    }
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    for (std::size_t a = 0; a < bases_.size(); ++a)
      for (std::size_t b = 0; b < a; ++b)
        if (!bases_[a].input->categories && !bases_[b].input->categories) pairs.emplace_back(b, a);
    if (rows < 10 * (as_index(size_) + pairs.size())) return;
    for (const auto& [a, b] : pairs) add(bases_[a].input->name + " x " + bases_[b].input->name, 1);
    pairs_ = std::move(pairs);
  }

  const std::vector<Group>& groups() const { return groups_; }
  Eigen::Index size() const { return size_; }
  void write(std::size_t row, Eigen::VectorXd& out) const {
    for (std::size_t k = 0; k < bases_.size(); ++k)
      bases_[k].write(row, out.segment(groups_[k].first, groups_[k].count));
    for (std::size_t k = 0; k < pairs_.size(); ++k)
      out[groups_[bases_.size() + k].first] =
          bases_[pairs_[k].first].first(row) * bases_[pairs_[k].second].first(row);
  }

 private:
  void add(std::string of, std::size_t count) {
    groups_.push_back({std::move(of), size_, index(count)});
    size_ += index(count);
  }

  std::vector<Basis> bases_;
  std::vector<std::pair<std::size_t, std::size_t>> pairs_;
  std::vector<Group> groups_;
  Eigen::Index size_ = 0;
};

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

std::optional<Estimate> mean_of(std::span<const double> values) {
  if (values.empty()) return std::nullopt;
  const auto n = static_cast<double>(values.size());
  const Eigen::Map<const Eigen::ArrayXd> of(values.data(), std::ssize(values));
  const double mean = of.mean();
  const double half = n > 1 ? kNormal95 * std::sqrt((of - mean).square().sum() / (n - 1) / n) : 0;
  return Estimate{mean, mean - half, mean + half};
}

double quantile(std::span<const double> sorted, double share) {
  const double place = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const double next = sorted[std::min(below + 1, sorted.size() - 1)];
  return sorted[below] + (place - static_cast<double>(below)) * (next - sorted[below]);
}

std::vector<double> ranks(std::span<const double> values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
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

std::vector<VarianceShare> variance_shares(const std::vector<Input>& inputs, std::span<const double> y) {
  const auto all = mean_of(y);
  if (!all || all->low == all->high) return {};
  // Few rows get straight lines.
  Terms terms(inputs, y.size(), 3);
  for (std::size_t degree = 2; degree > 0 && y.size() < 3 * as_index(terms.size()) + 2; --degree)
    terms = Terms(inputs, y.size(), degree);
  const auto n = static_cast<double>(y.size()), size = static_cast<double>(terms.size());
  if (terms.size() == 0 || n < 2 * size + 2) return {};
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(terms.size(), terms.size());
  Eigen::VectorXd with_y = Eigen::VectorXd::Zero(terms.size()), sum = with_y, row = with_y;
  double total = 0;
  for (std::size_t i = 0; i < y.size(); ++i) {
    terms.write(i, row);
    const double off = y[i] - all->value;
    normal.selfadjointView<Eigen::Lower>().rankUpdate(row);
    sum += row;
    with_y += off * row;
    total += off * off;
  }
  normal = normal.selfadjointView<Eigen::Lower>();
  normal -= sum * sum.transpose() / n;
  const Eigen::VectorXd coefficients = LeastSquares(normal, 1e-9).solve(with_y);
  const double unexplained = 1 - coefficients.dot(with_y) / total;
  std::vector<VarianceShare> out;
  for (const Group& group : terms.groups()) {
    const double fitted =
        coefficients.segment(group.first, group.count).dot(with_y.segment(group.first, group.count)) / total;
    out.push_back({group.of, fitted - static_cast<double>(group.count) * unexplained / (n - size - 1)});
  }
  std::ranges::stable_sort(out, std::greater{}, &VarianceShare::share);
  return out;
}

std::string owners_text(const std::vector<VarianceShare>& shares) {
  constexpr std::size_t kOwners = 3;
  constexpr double kLeast = 0.01;
  double all = 0;
  std::vector<std::string> told;
  for (const VarianceShare& each : shares) {
    all += each.share;
    if (told.size() < kOwners && each.share >= kLeast)
      told.push_back(fmt::format("{} {:.0f} %", each.of, 100 * each.share));
  }
  if (told.empty()) return shares.empty() ? "-" : "no input has 1 %";
  return fmt::format("{} ({:.0f} % explained)", fmt::join(told, ", "), std::max(0.0, 100 * all));
}

}  // namespace handsim::study
