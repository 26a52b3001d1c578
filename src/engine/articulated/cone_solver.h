// Contact impulses at the end of a step: for every contact the normal row obeys v_n >= 0, p_n >= 0,
// v_n p_n = 0, and friction is Coulomb's with the true cone: |p_t| <= mu p_n, v_t = 0 inside the cone and
// against p_t on it (Moreau 1988). Rows are v = b + W p, W = J H^-1 J^T (Delassus' operator). Solved block by
// block (projected Gauss-Seidel, each contact exactly), the sweeps sped up by nonsmooth nonlinear conjugate
// gradients (Silcowitz-Hansen, Niebe & Erleben 2010, The Visual Computer 26, 893-901).
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "handsim/core/pose.h"

namespace handsim::engine::articulated {

/// Rows of one contact or stop: the normal one, then two of friction, one of spinning and two of rolling,
/// those that there are.
struct Cone {
  std::size_t row = 0;
  double friction = 0;  ///< tangential per normal impulse; 0: no such rows
  double spinning = 0;  ///< [m], about the normal
  double rolling = 0;   ///< [m], across it
};
inline std::size_t row_count(const Cone& cone) {
  return 1U + (cone.friction > 0 ? 2U : 0U) + (cone.spinning > 0 ? 1U : 0U) + (cone.rolling > 0 ? 2U : 0U);
}

/// How far a solution got.
struct ConeReport {
  int sweeps = 0;
  double residual = 0;  ///< most that the last sweep still changed the velocity of a row [m/s or rad/s]
  bool solved = false;  ///< the residual is within the tolerance
};

class ConeSolver {
 public:
  /// Empties the problem and gives it so many rows; W and b are zero, p is zero.
  void reset(std::size_t rows);
  std::size_t rows() const { return rows_; }
  double& entry(std::size_t i, std::size_t j) { return W_[i * rows_ + j]; }
  double entry(std::size_t i, std::size_t j) const { return W_[i * rows_ + j]; }
  std::span<double> b() { return b_; }
  /// Impulses: where the solution starts from, and its result.
  std::span<double> p() { return p_; }

  /// W has to be symmetric and positive semidefinite, with a positive diagonal on rows that are to move.
  ConeReport solve(std::span<const Cone> cones, double tolerance, int most_sweeps);

 private:
  double sweep(std::span<const Cone> cones);
  double velocity(std::size_t row) const;
  /// Projects two rows from `row` on onto a disc.
  double solve_disc(std::size_t row, double radius);
  double solve_line(std::size_t row, double bound);
  double solve_contact(const Cone& cone, const Mat3& inverse);
  void invert_blocks(std::span<const Cone> cones);

  std::size_t rows_ = 0;
  std::vector<double> W_, b_, p_, last_, best_, direction_, change_;
  std::vector<Mat3> inverses_;  ///< of each cone's first three rows
};

}  // namespace handsim::engine::articulated
