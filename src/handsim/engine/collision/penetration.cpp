#include "handsim/engine/collision/penetration.h"

#include <algorithm>

namespace handsim::engine {

void CrossedBodies::find(const Collider& collider) {
  bodies_.clear();
  for (const Touch& touch : collider.touches()) {
    const Contact& first = collider.contacts()[touch.first];
    if (touch.surface.compliance || first.depth < kCrossedDepth) continue;
    const int a = moving_body(first.shape_a), b = moving_body(first.shape_b);
    if (a == model::kWorld || b == model::kWorld) continue;
    bodies_.push_back(a), bodies_.push_back(b);
  }
}

double CrossedBodies::inverse_mass(const Contact& contact) const {
  if (bodies_.empty()) return 0;
  double inverse_mass = 0;
  bool crossed = false;
  for (const int shape : {contact.shape_a, contact.shape_b}) {
    const int body = moving_body(shape);
    if (body == model::kWorld) continue;
    inverse_mass += 1 / model_.bodies[as_index(body)].mass;
    crossed = crossed || std::ranges::find(bodies_, body) != bodies_.end();
  }
  return crossed ? kCrossedSoftness * inverse_mass : 0;
}

/// The world where the shape is on a body that nothing pushes.
int CrossedBodies::moving_body(int shape) const {
  const int body = model_.shapes[as_index(shape)].body;
  return model_.bodies[as_index(body)].kinematic ? model::kWorld : body;
}

}  // namespace handsim::engine
