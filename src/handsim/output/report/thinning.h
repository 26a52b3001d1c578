// Curves and motions for a page: fewer rows, where a straight line between kept rows is as good.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace handsim::output {

/// Rows of a table over time such that straight lines between kept rows pass every other row within the
/// tolerance of each column; first and last stay. One pass: from a kept row, each column's admissible slopes
/// narrow until a row is outside them; the row before it is kept (swinging door, Bristol 1990).
/// @param times increasing [s]. @param values row by row. @param tolerances of each column.
std::vector<std::size_t> kept_rows(std::span<const double> times, std::span<const float> values,
                                   std::span<const double> tolerances);

/// The fewest doublings of the tolerances for which at most `most` rows are kept.
struct Thinned {
  std::vector<std::size_t> rows;
  double factor = 1;  ///< of the tolerances
};
Thinned thinned(std::span<const double> times, std::span<const float> values, std::vector<double> tolerances,
                std::size_t most);

}  // namespace handsim::output
