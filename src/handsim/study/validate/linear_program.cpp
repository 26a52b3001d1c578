#include "handsim/study/validate/linear_program.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

namespace handsim::study {

namespace {

constexpr int kMostPasses = 100;
constexpr double kPrimal = 1e-9, kDual = 1e-7, kGap = 1e-8;  ///< residuals that end the search
constexpr double kToTheWall = 0.99;                          ///< share of the way to the nearest bound

using Vector = Eigen::VectorXd;

/// The longest step up to 1 at which `of + step by` stays positive.
double room(const Vector& of, const Vector& by) {
  double out = 1;
  for (Eigen::Index i = 0; i < of.size(); ++i)
    if (by[i] < 0) out = std::min(out, -of[i] / by[i]);
  return out;
}

}  // namespace

std::optional<Vector> largest(const Vector& gain, const Eigen::MatrixXd& equal, const Vector& to,
                              const Vector& most) {
  std::vector<Eigen::Index> bounded;
  for (Eigen::Index i = 0; i < most.size(); ++i)
    if (std::isfinite(most[i])) bounded.push_back(i);
  const Eigen::Index n = gain.size(), rows = to.size(), k = static_cast<Eigen::Index>(bounded.size());
  // Rows of one size; a bound is a row x + rest = most.
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(rows + k, n + k);
  Vector b(rows + k), c = Vector::Zero(n + k);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double scale = std::max(equal.row(i).cwiseAbs().maxCoeff(), 1e-12);
    A.row(i).head(n) = equal.row(i) / scale;
    b[i] = to[i] / scale;
  }
  for (Eigen::Index i = 0; i < k; ++i) {
    A(rows + i, bounded[static_cast<std::size_t>(i)]) = A(rows + i, n + i) = 1;
    b[rows + i] = most[bounded[static_cast<std::size_t>(i)]];
  }
  c.head(n) = -gain;
  Vector x = Vector::Ones(n + k), s = x, y = Vector::Zero(rows + k);
  for (int pass = 0; pass < kMostPasses; ++pass) {
    const Vector primal = b - A * x, dual = c - A.transpose() * y - s;
    const double gap = x.dot(s) / static_cast<double>(x.size());
    if (primal.cwiseAbs().maxCoeff() < kPrimal && dual.cwiseAbs().maxCoeff() < kDual &&
        x.dot(s) < kGap * (1 + std::abs(c.dot(x))))
      return x.head(n);
    const Vector weight = x.cwiseQuotient(s);
    Eigen::MatrixXd normal = A * weight.asDiagonal() * A.transpose();
    normal.diagonal().array() += 1e-13;
    const Eigen::LDLT<Eigen::MatrixXd> factor(normal);
    Vector dx, dy, ds;
    const auto step = [&](const Vector& target) {
      dy = factor.solve(primal + A * (x.cwiseProduct(dual) - target).cwiseQuotient(s));
      ds = dual - A.transpose() * dy;
      dx = (target - x.cwiseProduct(ds)).cwiseQuotient(s);
    };
    step(-x.cwiseProduct(s));
    const double ahead = (x + room(x, dx) * dx).dot(s + room(s, ds) * ds) / static_cast<double>(x.size());
    const double share = std::pow(ahead / gap, 3);
    step((share * gap - (x.cwiseProduct(s) + dx.cwiseProduct(ds)).array()).matrix());
    const double primal_step = kToTheWall * room(x, dx), dual_step = kToTheWall * room(s, ds);
    x += primal_step * dx;
    y += dual_step * dy;
    s += dual_step * ds;
    if (!x.allFinite() || x.maxCoeff() > 1e12) break;
  }
  return std::nullopt;
}

}  // namespace handsim::study
