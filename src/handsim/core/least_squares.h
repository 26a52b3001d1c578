// Dense least squares, compiled once: a decomposition of Eigen takes seconds in each folder that compiles it.
#pragma once

#include <memory>

#include <Eigen/Core>

namespace handsim {

/// Factors of a matrix A (m x n) of any rank.
class LeastSquares {
 public:
  /// `threshold`: size against the largest pivot below which a pivot counts as zero.
  LeastSquares(const Eigen::MatrixXd& a, double threshold);
  ~LeastSquares();
  /// The shortest x (n) of all that make |A x - b| least.
  Eigen::VectorXd solve(const Eigen::VectorXd& b) const;

 private:
  struct Factors;
  std::unique_ptr<Factors> factors_;
};

/// Singular values of a matrix, from the largest.
Eigen::VectorXd singular_values(const Eigen::MatrixXd& a);

}  // namespace handsim
