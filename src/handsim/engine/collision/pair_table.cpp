#include "handsim/engine/collision/pair_table.h"

#include <algorithm>

namespace handsim::engine {

PairTable::PairTable(const model::Model& model)
    : model_(model), rules_(model.groups.size() * model.groups.size(), nullptr) {
  for (const model::ContactRule& rule : model.contact_rules) {
    const std::size_t a = as_index(rule.group_a), b = as_index(rule.group_b);
    rules_[a * model.groups.size() + b] = rules_[b * model.groups.size() + a] = &rule;
  }
}

model::Material PairTable::between(const model::Shape& a, const model::Shape& b) const {
  const auto material = [&](int index) { return model_.materials[as_index(index)]; };
  const std::optional<int> ruled = rule(a.group, b.group)->material;
  return ruled ? material(*ruled) : model::combined(material(a.material), material(b.material));
}

bool PairTable::meets_any(int group) const {
  for (int other = 0; other < static_cast<int>(model_.groups.size()); ++other)
    if (meet(group, other)) return true;
  return false;
}

UntestedPairs::UntestedPairs(const model::Model& model, const std::vector<bool>& immovable)
    : count_(model.bodies.size()), untested_(count_ * count_, false) {
  for (std::size_t a = 0; a < count_; ++a)
    for (std::size_t b = 0; b < count_; ++b)
      untested_[a * count_ + b] = a == b || (immovable[a] && immovable[b]);
  // The world at a wrist is no forearm: a palm that hangs on it meets what stands still.
  std::vector<bool> palm(count_, false);
  for (const model::HandIndex& hand : model.hands) palm[as_index(hand.palm)] = true;
  for (const model::Joint& joint : model.joints) {
    if (joint.parent == model::kWorld && palm[as_index(joint.child)]) continue;
    const std::size_t a = as_index(joint.parent), b = as_index(joint.child);
    untested_[a * count_ + b] = untested_[b * count_ + a] = true;
  }
  // What hangs on one part of a palm, or carries it, meets no part of it, as if the palm were one body.
  for (const model::HandIndex& hand : model.hands) {
    if (hand.palm_parts.empty()) continue;
    std::vector<int> parts = hand.palm_parts;
    parts.push_back(hand.palm);
    std::vector<int> near = parts;
    if (hand.forearm) near.push_back(*hand.forearm);
    for (const model::Joint& joint : model.joints)
      if (std::ranges::find(parts, joint.parent) != parts.end()) near.push_back(joint.child);
    for (const int part : parts)
      for (const int other : near) {
        untested_[as_index(part) * count_ + as_index(other)] =
            untested_[as_index(other) * count_ + as_index(part)] = true;
      }
  }
}

}  // namespace handsim::engine
