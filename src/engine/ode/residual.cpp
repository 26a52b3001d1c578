#include "handsim/engine/ode/residual.h"

#include <cmath>

namespace handsim::engine::ode {

namespace {

void raise(ResidualPeak& peak, double value, int where) {
  if (value > peak.value) peak = {value, where};
}

}  // namespace

Residual ResidualMeter::measure(const model::State& before, const std::vector<OdeBody>& bodies, double step,
                                const Contacts* contacts) {
  moved_ = before;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    if (bodies[i].id == nullptr) continue;
    const model::BodyState now = read_state(bodies[i]);
    moved_.bodies[i].v = now.v;
    moved_.bodies[i].w = now.w;
  }
  Residual out;
  for (std::size_t j = 0; j < model_.joints.size(); ++j) {
    const model::Joint& joint = model_.joints[j];
    rows_.clear();
    append_constraints(joint, moved_, rows_);
    for (const Row& row : rows_) {
      const bool linear = !row.child_v.isZero(0) || !row.parent_v.isZero(0);
      raise(linear ? out.linear : out.angular, std::abs(rate(row, moved_) + erp_ / step * row.value),
            static_cast<int>(j));
    }
  }
  if (contacts == nullptr) return out;
  for (const Touch& touch : contacts->touches()) {
    if (touch.surface.compliance) continue;
    for (std::size_t i = touch.first; i < touch.first + static_cast<std::size_t>(touch.count); ++i) {
      const Contact& contact = contacts->list()[i];
      const auto speed = [&](int shape) {
        const model::BodyState& body =
            moved_.bodies[static_cast<std::size_t>(model_.shapes[static_cast<std::size_t>(shape)].body)];
        return contact.normal.dot(body.v + body.w.cross(contact.position - body.p));
      };
      raise(out.contact, speed(contact.shape_b) - speed(contact.shape_a), contact.shape_a);
    }
  }
  return out;
}

}  // namespace handsim::engine::ode
