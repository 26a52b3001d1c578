// Which contact groups meet, with what material, as the model's rules say, and which bodies never do.
#pragma once

#include <vector>

#include "handsim/model/model.h"

namespace handsim::engine {

/// For each pair of contact groups the rule that names it, the last of several.
class PairTable {
 public:
  /// The model must outlive this object.
  explicit PairTable(const model::Model& model);
  bool meet(int group_a, int group_b) const { return rule(group_a, group_b) != nullptr; }
  bool meets_any(int group) const;
  /// The material between two shapes that meet: that of their rule, or the two combined where it has none.
  model::Material between(const model::Shape& a, const model::Shape& b) const {
    model::Material out;
    set_between(a, b, out);
    return out;
  }
  /// The same, in the place of another one.
  void set_between(const model::Shape& a, const model::Shape& b, model::Material& out) const;

 private:
  const model::ContactRule* rule(int a, int b) const {
    return rules_[as_index(a) * model_.groups.size() + as_index(b)];
  }
  const model::Model& model_;
  std::vector<const model::ContactRule*> rules_;  ///< groups by groups, symmetric; null: never meet
};

/// Pairs of bodies never tested: a body and itself, jointed ones (but palm and world), two fixed ones.
class UntestedPairs {
 public:
  UntestedPairs(const model::Model& model, const std::vector<bool>& immovable);
  bool operator()(int body_a, int body_b) const {
    return untested_[as_index(body_a) * count_ + as_index(body_b)];
  }

 private:
  std::size_t count_;
  std::vector<bool> untested_;  ///< count_ by count_, symmetric
};

}  // namespace handsim::engine
