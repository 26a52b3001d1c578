// The moment arms of many tendons at once: the polynomials of model::path_state in arrays, two at a time,
// with the same bits.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "handsim/model/muscle.h"

namespace handsim::engine {

class PackedArms {
 public:
  /// Appends the arms of a path, which must outlive this. @return the index of the first
  std::size_t add(const model::TendonPath& path);
  /// At coordinates of the model [rad].
  void evaluate(std::span<const double> q);

  /// Excursion of the path that was added n-th [m].
  double excursion(std::size_t n) const { return excursion_[n]; }
  /// By index: the arm [m], its derivative by its own coordinate [m/rad], that coordinate.
  const double* arm() const { return arm_.data(); }
  const double* bend() const { return bend_.data(); }
  const int* dof() const { return dof_.data(); }

 private:
  /// Polynomials of four arms: coefficients of the arm, of its integral, ends of the range.
  struct Block {
    std::array<std::array<double, 4>, model::kArmTerms> c{}, integral{};
    std::array<double, 4> low{}, high{};
  };
  struct Path {
    const model::TendonPath* path = nullptr;
    std::size_t first = 0, end = 0;  ///< of its arms
  };
  std::vector<Path> paths_;
  std::vector<Block> blocks_;
  std::vector<int> dof_;
  // By index, filled up to whole blocks.
  std::vector<double> angle_, within_, arm_, bend_, part_;
  std::vector<double> excursion_;  ///< by path
};

}  // namespace handsim::engine
