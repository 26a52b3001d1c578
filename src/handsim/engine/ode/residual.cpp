#include "handsim/engine/ode/residual.h"

#include <cmath>

namespace handsim::engine::ode {

namespace {

void raise(ResidualPeak& peak, double value, std::size_t where) {
  if (value > peak.value) peak = {value, static_cast<int>(where)};
}

Vec3 across(const Vec3& v, const Vec3& axis) { return v - axis * axis.dot(v); }

using Velocity = Eigen::Map<const Vec3>;

/// Velocity after the step, angular velocity or not; of a body that ODE does not move the one before.
Velocity after(const double* of_ode, const Vec3& before) {
  return Velocity(of_ode != nullptr ? of_ode : before.data());
}

}  // namespace

ResidualMeter::ResidualMeter(const model::Model& model, double erp) : model_(model), erp_(erp) {
  for (const model::Joint& joint : model.joints) {
    Sides& sides = sides_.emplace_back();
    sides.turned = joint.parent_frame.q * joint.child_frame.q.conjugate();
    if (joint.axes.empty()) continue;
    sides.slide = joint.parent_frame.q * joint.axes[0].axis;
    if (joint.type().turns > 0)
      sides.in_parent = joint.parent_frame.q * joint.axes[as_index(joint.type().slides)].axis;
    sides.in_child = joint.child_frame.q * joint.axes.back().axis;
  }
}

/// @param rate ERP / h [1/s]
ResidualMeter::Found ResidualMeter::of_joint(std::size_t index, const model::State& before,
                                             std::span<const OdeBody> bodies, double rate) const {
  const model::Joint& joint = model_.joints[index];
  const Sides& sides = sides_[index];
  const auto at_p = static_cast<std::size_t>(joint.parent), at_c = static_cast<std::size_t>(joint.child);
  const model::BodyState &p = before.bodies[at_p], &c = before.bodies[at_c];
  const Velocity v_p = after(bodies[at_p].v, p.v), v_c = after(bodies[at_c].v, c.v);
  const Velocity w_p = after(bodies[at_p].w, p.w), w_c = after(bodies[at_c].w, c.w);
  const Vec3 r_p = p.q * joint.parent_frame.p, r_c = c.q * joint.child_frame.p;
  const Vec3 gap = c.p + r_c - p.p - r_p;
  const Vec3 spin = w_c - w_p;
  const Vec3 apart = v_c + w_c.cross(r_c) - v_p - w_p.cross(r_p) + rate * gap;
  // The axis of a slide turns with the parent.
  Found found{joint.slides(0) ? across(apart - w_p.cross(gap), p.q * sides.slide).squaredNorm()
                              : apart.squaredNorm()};
  const Vec3 a = p.q * sides.in_parent, b = c.q * sides.in_child;
  if (joint.type().turns == 0) {
    // Small, and as ODE takes it.
    const Quat out = c.q * (p.q * sides.turned).conjugate();
    const Vec3 turned = std::copysign(2.0, out.w()) * out.vec();
    found.angular2 = (spin + rate * turned).squaredNorm();
  } else if (joint.type().turns == 1) {
    found.angular2 = across(spin + rate * a.cross(b), a).squaredNorm();
  } else if (joint.type().turns == 2) {
    const double turn = rate * a.dot(b) - spin.dot(a.cross(b));
    found.angular2 = turn * turn;
  }
  return found;
}

Residual ResidualMeter::measure(const model::State& before, std::span<const OdeBody> bodies, double step,
                                const Contacts* contacts) const {
  Residual out;
  for (std::size_t j = 0; j < model_.joints.size(); ++j) {
    const Found found = of_joint(j, before, bodies, erp_ / step);
    raise(out.linear, found.linear2, j);
    raise(out.angular, found.angular2, j);
  }
  out.linear.value = std::sqrt(out.linear.value);
  out.angular.value = std::sqrt(out.angular.value);
  if (contacts == nullptr) return out;
  for (const Touch& touch : contacts->touches()) {
    if (touch.surface.compliance) continue;
    for (std::size_t i = touch.first; i < touch.first + static_cast<std::size_t>(touch.count); ++i) {
      const Contact& contact = contacts->list()[i];
      const auto speed = [&](int shape) {
        const auto at = static_cast<std::size_t>(model_.shapes[static_cast<std::size_t>(shape)].body);
        const model::BodyState& body = before.bodies[at];
        const Vec3 arm = contact.position - body.p;
        return contact.normal.dot(after(bodies[at].v, body.v) + after(bodies[at].w, body.w).cross(arm));
      };
      // What is about to touch may come nearer by the gap.
      const double allowed = contact.depth < 0 ? -contact.depth / step : 0;
      raise(out.contact, speed(contact.shape_b) - speed(contact.shape_a) - allowed,
            static_cast<std::size_t>(contact.shape_a));
    }
  }
  return out;
}

}  // namespace handsim::engine::ode
