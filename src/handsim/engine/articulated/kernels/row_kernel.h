// Inner loops of the contact solver by instruction set, with one order of sums: all give the same bits.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace handsim::engine::articulated {

/// Unknowns (or columns) first, first + 1, ... end - 1.
struct Run {
  int first = 0, end = 0;
  int size() const { return end - first; }
};

/// An unbranched piece of a tree. Its rows of the factor have entries in the chain itself and in runs of
/// later unknowns; `next` is the first later chain among these, or the number of chains.
struct Chain {
  Run own;
  std::size_t first_run = 0, run_count = 0;
  std::size_t next = 0;
};

/// Rows of an upper triangle: entry (i, j) is `row(i)[j]`, j >= i.
struct Triangle {
  double* entries = nullptr;
  const std::size_t* start = nullptr;
  double* row(int i) const { return entries + start[i]; }
};

/// M, or M = U^T U with the inverse of U's diagonal.
struct Factor {
  Triangle M;
  const Chain* chains = nullptr;
  std::size_t chain_count = 0;
  const Run* runs = nullptr;
};

/// M - C G^T: unknowns by columns; the ranges are of the columns with entries in each chain.
struct Coupling {
  const Run* ranges = nullptr;
  std::size_t columns = 0;
  double *C = nullptr, *G = nullptr, *K = nullptr;
  double* h = nullptr;            ///< a number for each column
  std::size_t* pivots = nullptr;  ///< row exchanges of K = LU
};

/// Rows of a contact's Jacobian, `stride` apart, over the unknowns of its runs.
struct RowBlock {
  const double* J = nullptr;
  std::size_t rows = 0, stride = 0;
  const Run* runs = nullptr;
  std::size_t run_count = 0;
};

/// Numbers of a motion or a wrench: three of rotation, a zero, three of translation, a zero.
inline constexpr std::size_t kSpatial = 8;

struct RowKernel {
  /// M = U^T U in place, its diagonal inverted.
  void (*factor)(const Factor&);
  /// x = U^-T x, then x = U^-1 x, over a range of chains.
  void (*eliminate)(const Factor&, double* x, std::size_t first_chain, std::size_t end);
  void (*substitute_back)(const Factor&, double* x, std::size_t first_chain, std::size_t end);
  /// C = U^-T C, G = U^-T G.
  void (*eliminate_coupling)(const Factor&, const Coupling&);
  /// K = 1 - G^T C, then K = LU.
  void (*factor_coupling)(const Factor&, const Coupling&);
  /// d += C K^-1 G^T d.
  void (*apply_coupling)(const Factor&, const Coupling&, double* d);
  /// M += J^T D J, D = diag(normal, [xx xy; xy yy]); of two rows without the first, of one row xx alone.
  void (*add_stiffness)(const Triangle&, const RowBlock&, double normal, const std::array<double, 3>& D);
  /// out = J x.
  void (*multiply)(const RowBlock&, const double* x, double* out);
  /// to -= J^T p.
  void (*subtract_transposed)(const RowBlock&, const double* p, double* to);
  /// to += A x, A symmetric; `last`: last column of each row.
  void (*add_product)(const Triangle& A, const int* last, int n, const double* x, double* to);
  /// V_i = V_parent + S_i x_i from the roots on: what the unknowns carry. V_n, the roots' parent, is zero.
  void (*compute_motions)(const double* S, const int* parent, int n, const double* x, double* V);
  /// to_i -= S_i . W_i and W_parent += W_i, from the tips on: what wrenches W do to the unknowns.
  void (*subtract_wrenches)(const double* S, const int* parent, int n, double* W, double* to);
  /// out = G V of `rows` wrenches G.
  void (*project)(const double* G, std::size_t rows, const double* V, double* out);
  /// W += G^T p.
  void (*add_wrenches)(const double* G, std::size_t rows, const double* p, double* W);
};

}  // namespace handsim::engine::articulated
