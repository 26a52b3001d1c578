// Why muscles leave a part of the torques of a motion undone. Each step's reserve is what the best
// activations would leave, and what the activations that are reached leave beside it.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "handsim/model/model.h"

namespace handsim::study {

/// Shares of the sum of squares of all reserves; together 1. One below 0 makes the others' sum smaller.
struct Undone {
  std::map<std::string, double> beyond;  ///< the strength of a muscle, which is fully active
  double no_balance = 0;                 ///< no balance of muscles, which turn several axes at once, gives it
  double late = 0;   ///< the torque changes faster than activations follow: as noise of points makes it
  double other = 0;  ///< tendons that stretch, bands, and joints that are fused
};

class UndoneCauses {
 public:
  /// The model must outlive this. @param axes coordinates of the motion
  UndoneCauses(const model::Model& model, std::span<const std::size_t> axes);

  /// Coordinates that muscles are asked for, in the order of `missing`: those that are not fused.
  const std::vector<std::size_t>& asked() const { return asked_; }
  /// A step. @param missing torques that the best activations leave [N m] @param best, reached activations
  /// @param reserve by coordinate [N m]
  void add(std::span<const double> q, std::span<const double> missing, std::span<const double> best,
           std::span<const double> reached, std::span<const double> reserve);
  Undone shares() const;

 private:
  void beyond(std::size_t dof, double missing, double square);

  const model::Model& model_;
  std::vector<std::size_t> asked_, fused_;
  std::vector<double> pull_;  ///< of each muscle, where it is fully active: [N m] about each coordinate
  std::vector<unsigned char> waits_;  ///< for activations, by coordinate
  Undone sums_;
  double all_ = 0;
};

}  // namespace handsim::study
