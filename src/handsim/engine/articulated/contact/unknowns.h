// Unknowns: joint rates of whole trees, with entries in a sparse matrix (Featherstone 2008, section 6.5).
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "handsim/core/index.h"
#include "handsim/engine/articulated/kernels/kernels.h"

namespace handsim::engine::articulated {

/// The unknowns of a problem: children stand before parents, a tree's unknowns together, its root last.
struct Unknowns {
  std::vector<int> ids;                ///< in the numbers of the largest set that these were chosen from
  std::vector<int> first, last;        ///< of each: first unknown below it; last unknown above it
  std::vector<int> parent;             ///< next unknown up the tree; size() for a root
  std::vector<std::size_t> row_start;  ///< matrix entry (i, j) is at row_start[i] + j, j from i to last[i]
  std::size_t entries = 0;             ///< of the matrix
  std::vector<Run> chains;             ///< unbranched pieces of trees
  std::vector<Run> trees;
  std::vector<std::size_t> chain_of;  ///< of each unknown
  std::vector<int> tree_of;           ///< of each unknown

  int size() const { return static_cast<int>(first.size()); }
  const Run& tree(int unknown) const { return trees[as_index(tree_of[as_index(unknown)])]; }
  void reserve(std::size_t n);
  /// @param first_of for every unknown i the least j <= i with a matrix entry (i, j), whatever the state
  void assign(std::span<const int> first_of);
  /// Becomes the chosen unknowns, those of whole trees in ascending order. @returns false where nothing
  /// changes
  bool choose(const Unknowns& from, std::span<const int> chosen);
  /// The largest number of unknowns that can move two bodies against each other.
  std::size_t widest() const;

 private:
  void lay_out();
};

/// Computes the indices at which the rows of an upper triangle start, each from its diagonal to its last
/// entry.
/// @returns the number of all entries
std::size_t place_rows(std::span<const int> last, std::vector<std::size_t>& row_start);

/// Makes room in vectors.
template <class... Vectors>
void reserve_each(std::size_t count, Vectors&... vectors) {
  (vectors.reserve(count), ...);
}

}  // namespace handsim::engine::articulated
