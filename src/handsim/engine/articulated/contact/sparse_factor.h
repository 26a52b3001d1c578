// The linear system of a Newton step: a sparse Cholesky factor of the symmetric part M of the residual's
// derivative, and the low-rank unsymmetric part of sliding contacts. The pattern is by chains of unknowns:
// fingers couple only by what they hold. Factor and pattern stay for the next problem.
#pragma once

#include <vector>

#include "handsim/core/archive.h"
#include "handsim/engine/articulated/contact/equation.h"

namespace handsim::engine::articulated {

/// The factor of a problem's derivative, and its pattern.
class SparseFactor {
 public:
  void reserve(const Unknowns& most);
  /// Computes the pattern, unless unknowns and contacts are those of the last problem.
  void update_pattern(const ContactProblem& p, Workspace& w);
  /// The number of multiplications of a factorisation, with rows counted as full.
  double work() const;
  /// Factors the derivative of the residual that the workspace has.
  void factor(ContactProblem& p, Workspace& w);
  /// Factors A alone: the contacts' factor is lost.
  void factor_inertia(const ContactProblem& p, Workspace& w);
  /// x becomes the solution for the right side x. @param w for its kernel
  void solve(const Workspace& w, double* x);
  /// Solves for the unknowns of one tree that no entry couples to other trees, and leaves all others.
  void solve_tree(const Workspace& w, double* x, const Unknowns& unknowns, const Run& tree);

  /// @returns whether the factor is of the same unknowns, contacts and active set as the problem, and is to
  /// be tried. After repeated failures, as in fast motion, more and more problems pass between two trials.
  bool begin_trial(const ContactProblem& p, Workspace& w);
  /// Reports whether the trial solved the problem.
  void end_trial(bool solved);
  void forget();
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);

 private:
  /// A disc that slides.
  struct Column {
    std::size_t contact = 0, disc = 0;
  };

  void compute_pattern(const ContactProblem& p, Workspace& w, std::span<const ContactRows> contacts);
  void assemble(ContactProblem& p, Workspace& w);
  void add_stiffness(const ContactProblem& p, const Workspace& w, const ContactRows& contact);
  void list_columns(const ContactProblem& p);
  void add_coupling(const ContactProblem& p);
  double& entry(int i, int j) { return M_[row_start_[as_index(i)] + as_index(j)]; }
  Factor view() { return {{M_.data(), row_start_.data()}, chains_.data(), chains_.size(), runs_.data()}; }
  Coupling coupling() {
    return {column_range_.data(), columns_.size(), C_.data(), G_.data(), K_.data(), h_.data(),
            pivots_.data()};
  }

  std::vector<Chain> chains_;
  std::vector<Run> runs_;
  std::vector<int> last_;  ///< last column of each row
  std::vector<std::size_t> row_start_;
  std::size_t entries_ = 0;
  /// Unknowns and contacts that the pattern was computed for; and whether it was computed.
  std::vector<int> layout_;
  bool known_ = false;

  std::vector<double> M_;
  /// Friction by normal impulse: M - C G^T is the whole derivative. C, G by columns; K = 1 - G^T C.
  std::vector<double> C_, G_, K_;
  std::vector<std::size_t> pivots_;
  std::vector<Column> columns_;
  std::vector<Run> column_range_;  ///< of each chain: columns that have entries there
  std::vector<double> h_;
  std::vector<int> active_;  ///< active set of the factor; empty: there is none
  /// Failures in a row of an earlier problem's factor, and problems until it is tried again.
  int failures_ = 0, problems_to_pass_ = 0;
};

}  // namespace handsim::engine::articulated
