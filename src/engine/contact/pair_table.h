// Which contact groups meet, as the model's rules say, and which bodies never do.
#pragma once

#include <vector>

#include "handsim/model/model.h"

namespace handsim::engine {

/// For each pair of contact groups whether a rule names it, and the material of the pair.
class PairTable {
 public:
  explicit PairTable(const model::Model& model);
  bool meet(int group_a, int group_b) const { return entry(group_a, group_b) != kNever; }
  bool meets_any(int group) const;
  /// Index of a material, or kCombined.
  int material(int group_a, int group_b) const { return entry(group_a, group_b); }

 private:
  static constexpr int kNever = -2;
  int entry(int a, int b) const {
    return table_[static_cast<std::size_t>(a) * groups_ + static_cast<std::size_t>(b)];
  }
  std::size_t groups_;
  std::vector<int> table_;
};

/// Pairs of bodies whose shapes are never tested against each other: a body and itself, jointed bodies
/// (but a palm and the world), two immovable bodies.
class UntestedPairs {
 public:
  UntestedPairs(const model::Model& model, const std::vector<bool>& immovable);
  bool operator()(int body_a, int body_b) const {
    return untested_[static_cast<std::size_t>(body_a) * count_ + static_cast<std::size_t>(body_b)];
  }

 private:
  std::size_t count_;
  std::vector<bool> untested_;  ///< count_ by count_, symmetric
};

}  // namespace handsim::engine
