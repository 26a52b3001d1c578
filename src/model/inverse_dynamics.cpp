#include "handsim/model/inverse_dynamics.h"

#include "handsim/core/index.h"

namespace handsim::model {

namespace {

/// Angular momentum about the centre of mass [kg m^2/s].
Vec3 angular_momentum(const Body& body, const BodyState& state) {
  return state.q * (body.inertia * (state.q.conjugate() * state.w));
}

/// For each body: true if the joint moves it.
std::vector<bool> distal_bodies(const Model& model, const Joint& joint) {
  std::vector<bool> out(model.bodies.size(), false);
  out[at(joint.child)] = true;
  for (const Joint& other : model.joints)
    if (out[at(other.parent)]) out[at(other.child)] = true;
  return out;
}

}  // namespace

std::vector<double> inverse_dynamics(const Model& model, const State& from, const State& to,
                                     const Vec3& gravity) {
  const double step = to.time - from.time;
  std::vector<double> out(at(model.dof_count()), 0.0);
  for (const Joint& joint : model.joints) {
    const std::vector<bool> distal = distal_bodies(model, joint);
    const BodyState &parent = from.bodies[at(joint.parent)], &child = from.bodies[at(joint.child)];
    const Vec3 anchor = child.p + child.q * joint.child_frame.p;
    Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
    for (std::size_t i = 1; i < model.bodies.size(); ++i) {
      if (!distal[i]) continue;
      const BodyState &start = from.bodies[i], &end = to.bodies[i];
      const Vec3 needed = model.bodies[i].mass * ((end.v - start.v) / step - gravity);
      force += needed;
      moment += (start.p - anchor).cross(needed) +
                (angular_momentum(model.bodies[i], end) - angular_momentum(model.bodies[i], start)) / step;
    }
    for (std::size_t k = 0; k < joint.axes.size(); ++k) {
      const Vec3 axis = k == 0 ? parent.q * (joint.parent_frame.q * joint.axes[0].axis)
                               : child.q * (joint.child_frame.q * joint.axes[1].axis);
      out[at(joint.first_dof) + k] = (joint.kind == JointKind::slider ? force : moment).dot(axis);
    }
  }
  return out;
}

}  // namespace handsim::model
