// Joint torques from the change of momentum between two states, body by body: an oracle that shares no code
// with handsim/model/newton_euler.h.
#pragma once

#include <vector>

#include "handsim/core/index.h"
#include "handsim/model/state.h"

namespace handsim::test {

/// For each body: true if the joint moves it.
inline std::vector<bool> distal_bodies(const model::Model& model, const model::Joint& joint) {
  std::vector<bool> out(model.bodies.size(), false);
  out[as_index(joint.child)] = true;
  for (const model::Joint& other : model.joints)
    if (out[as_index(other.parent)]) out[as_index(other.child)] = true;
  return out;
}

/// Torques along all coordinates that move the bodies from one state to a later one: for each joint, the rate
/// of change of the momentum of all bodies distal to it, less gravity [m/s^2], about the child's anchor and
/// along the joint's axes in the first state. Means over the time between the states, accurate to first order
/// in it; zero for balls. Includes the torques of active stops and contacts. For models without loops.
inline std::vector<double> momentum_torques(const model::Model& model, const model::State& from,
                                            const model::State& to, const Vec3& gravity) {
  const auto spin = [](const model::Body& body, const model::BodyState& state) {
    return Vec3(state.q * (body.inertia * (state.q.conjugate() * state.w)));
  };
  const double step = to.time - from.time;
  std::vector<double> out(as_index(model.dof_count()), 0.0);
  for (const model::Joint& joint : model.joints) {
    const std::vector<bool> distal = distal_bodies(model, joint);
    const model::BodyState &parent = from.bodies[as_index(joint.parent)],
                           &child = from.bodies[as_index(joint.child)];
    const Vec3 anchor = child.p + child.q * joint.child_frame.p;
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
    for (std::size_t i = 1; i < model.bodies.size(); ++i) {
      if (!distal[i]) continue;
      const model::BodyState &start = from.bodies[i], &end = to.bodies[i];
      const Vec3 needed = model.bodies[i].mass * ((end.v - start.v) / step - gravity);
      force += needed;
      moment += (start.p - anchor).cross(needed) +
                (spin(model.bodies[i], end) - spin(model.bodies[i], start)) / step;
    }
    for (std::size_t k = 0; k < joint.axes.size(); ++k) {
      const Vec3 axis = k == 0 ? parent.q * (joint.parent_frame.q * joint.axes[0].axis)
                               : child.q * (joint.child_frame.q * joint.axes[1].axis);
      out[as_index(joint.first_dof) + k] =
          (joint.kind == model::JointKind::slider ? force : moment).dot(axis);
    }
  }
  return out;
}

}  // namespace handsim::test
