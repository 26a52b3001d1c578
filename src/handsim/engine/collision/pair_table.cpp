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

namespace {

/// Radius of a round shape, or 0.
double radius_of(const model::Shape& shape) {
  using model::ShapeKind;
  const bool round = shape.kind == ShapeKind::capsule || shape.kind == ShapeKind::sphere ||
                     shape.kind == ShapeKind::cylinder;
  return round ? shape.radius : 0;
}

bool of_hand(const model::Shape& shape) { return shape.part < model::Part::object; }

/// Radius of the pad between two shapes that share one material: a hand's, else the smaller.
double pad_radius(const model::Shape& a, const model::Shape& b) {
  const double of_a = radius_of(a), of_b = radius_of(b);
  if (of_hand(a) != of_hand(b)) return of_hand(a) ? of_a : of_b;
  return of_a > 0 && of_b > 0 ? std::min(of_a, of_b) : of_a + of_b;
}

void set_radius(model::Material& surface, double radius) {
  if (!surface.compliance) return;
  surface.compliance->radius = radius;
  const auto& law = surface.compliance->law;
  if (law && law->radius > 0 && radius > 0) surface.compliance->size = radius / law->radius;
}

}  // namespace

void PairTable::set_between(const model::Shape& a, const model::Shape& b, model::Material& out) const {
  if (const std::optional<int> ruled = rule(a.group, b.group)->material) {
    out = model_.materials[as_index(*ruled)];
    set_radius(out, pad_radius(a, b));
    return;
  }
  model::Material of_a = model_.materials[as_index(a.material)],
                  of_b = model_.materials[as_index(b.material)];
  set_radius(of_a, radius_of(a));
  set_radius(of_b, radius_of(b));
  out = model::combined(of_a, of_b);
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
