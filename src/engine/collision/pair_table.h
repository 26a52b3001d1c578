// Which contact groups meet, with what material, as the model's rules say, and which bodies never do.
#pragma once

#include <vector>

#include "handsim/model/model.h"

namespace handsim::engine {

/// For each pair of contact groups the rule that names it, the last of several.
class PairTable {
 public:
  /// The model must outlive this.
  explicit PairTable(const model::Model& model);
  bool meet(int group_a, int group_b) const { return rule(group_a, group_b) != nullptr; }
  bool meets_any(int group) const;
  /// What the surfaces of two shapes that meet are to each other: the material of their rule, or the two
  /// combined where it has none.
  model::Material between(const model::Shape& a, const model::Shape& b) const;

 private:
  const model::ContactRule* rule(int a, int b) const {
    return rules_[static_cast<std::size_t>(a) * model_.groups.size() + static_cast<std::size_t>(b)];
  }
  const model::Model& model_;
  std::vector<const model::ContactRule*> rules_;  ///< groups by groups, symmetric; null: never meet
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
