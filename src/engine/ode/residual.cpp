#include "handsim/engine/ode/residual.h"

#include <cmath>

namespace handsim::engine::ode {

namespace {

using model::JointKind;

void raise(ResidualPeak& peak, double value, std::size_t where) {
  if (value > peak.value) peak = {value, static_cast<int>(where)};
}

Vec3 across(const Vec3& v, const Vec3& axis) { return v - axis * axis.dot(v); }

/// Poses before the step with velocities after it.
model::BodyState moved(const model::State& before, std::span<const OdeBody> bodies, int index) {
  const auto i = static_cast<std::size_t>(index);
  model::BodyState out = before.bodies[i];
  if (bodies[i].id == nullptr) return out;
  out.v = Vec3(bodies[i].v[0], bodies[i].v[1], bodies[i].v[2]);
  out.w = Vec3(bodies[i].w[0], bodies[i].w[1], bodies[i].w[2]);
  return out;
}

}  // namespace

ResidualMeter::ResidualMeter(const model::Model& model, double erp) : model_(model), erp_(erp) {
  for (const model::Joint& joint : model.joints) {
    Sides& sides = sides_.emplace_back();
    sides.turned = joint.parent_frame.q * joint.child_frame.q.conjugate();
    if (joint.axes.empty()) continue;
    sides.in_parent = joint.parent_frame.q * joint.axes.front().axis;
    sides.in_child = joint.child_frame.q * joint.axes.back().axis;
  }
}

/// @param rate ERP / h [1/s]
ResidualMeter::Found ResidualMeter::of_joint(std::size_t index, const model::BodyState& p,
                                             const model::BodyState& c, double rate) const {
  const model::Joint& joint = model_.joints[index];
  const Sides& sides = sides_[index];
  const Vec3 r_p = p.q * joint.parent_frame.p, r_c = c.q * joint.child_frame.p;
  const Vec3 gap = c.p + r_c - p.p - r_p;
  const Vec3 spin = c.w - p.w;
  const Vec3 apart = c.v + c.w.cross(r_c) - p.v - p.w.cross(r_p) + rate * gap;
  switch (joint.kind) {
    case JointKind::ball:
      return {apart.norm(), 0};
    case JointKind::hinge: {
      const Vec3 axis = p.q * sides.in_parent;
      return {apart.norm(), across(spin + rate * axis.cross(c.q * sides.in_child), axis).norm()};
    }
    case JointKind::universal: {
      const Vec3 a = p.q * sides.in_parent, b = c.q * sides.in_child;
      return {apart.norm(), std::abs(rate * a.dot(b) - spin.dot(a.cross(b)))};
    }
    case JointKind::slider: {
      const Vec3 axis = p.q * sides.in_parent;
      // Small, and as ODE takes it.
      const Quat out = c.q * (p.q * sides.turned).conjugate();
      const Vec3 turned = std::copysign(2.0, out.w()) * out.vec();
      // The axis turns with the parent.
      return {across(apart - p.w.cross(gap), axis).norm(), (spin + rate * turned).norm()};
    }
  }
  return {};
}

Residual ResidualMeter::measure(const model::State& before, std::span<const OdeBody> bodies, double step,
                                const Contacts* contacts) const {
  Residual out;
  for (std::size_t j = 0; j < model_.joints.size(); ++j) {
    const model::Joint& joint = model_.joints[j];
    const Found found =
        of_joint(j, moved(before, bodies, joint.parent), moved(before, bodies, joint.child), erp_ / step);
    raise(out.linear, found.linear, j);
    raise(out.angular, found.angular, j);
  }
  if (contacts == nullptr) return out;
  for (const Touch& touch : contacts->touches()) {
    if (touch.surface.compliance) continue;
    for (std::size_t i = touch.first; i < touch.first + static_cast<std::size_t>(touch.count); ++i) {
      const Contact& contact = contacts->list()[i];
      const auto speed = [&](int shape) {
        const model::BodyState body =
            moved(before, bodies, model_.shapes[static_cast<std::size_t>(shape)].body);
        return contact.normal.dot(body.v + body.w.cross(contact.position - body.p));
      };
      raise(out.contact, speed(contact.shape_b) - speed(contact.shape_a),
            static_cast<std::size_t>(contact.shape_a));
    }
  }
  return out;
}

}  // namespace handsim::engine::ode
