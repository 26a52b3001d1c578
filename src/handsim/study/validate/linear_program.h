// Linear programs with bounds, by interior points; private to this folder.
#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

namespace handsim::study {

/// The largest `gain . x` with `equal x = to` and 0 <= x <= most, by Mehrotra's predictor and corrector
/// (SIAM J Optim 1992;2:575). @param most of each x; infinite: no bound @return absent where no x is within
/// the bounds, or `gain . x` has none
std::optional<Eigen::VectorXd> largest(const Eigen::VectorXd& gain, const Eigen::MatrixXd& equal,
                                       const Eigen::VectorXd& to, const Eigen::VectorXd& most);

}  // namespace handsim::study
