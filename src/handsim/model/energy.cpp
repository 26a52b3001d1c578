#include "handsim/model/energy.h"

namespace handsim::model {

double kinetic_energy(const Model& model, const State& state) {
  double energy = 0;
  for (std::size_t i = 1; i < model.bodies.size(); ++i) {
    const Body& body = model.bodies[i];
    if (body.kinematic) continue;
    const BodyState& at = state.bodies[i];
    const Vec3 w_B = at.q.conjugate() * at.w;
    energy += 0.5 * (body.mass * at.v.squaredNorm() + w_B.dot(body.inertia * w_B));
  }
  return energy;
}

double potential_energy(const Model& model, const State& state, const Effects& effects) {
  double energy = 0;
  if (effects.has(Effect::gravity))
    for (std::size_t i = 1; i < model.bodies.size(); ++i)
      if (!model.bodies[i].kinematic) energy -= model.bodies[i].mass * model.gravity.dot(state.bodies[i].p);
  if (!effects.has(Effect::passive_tissue)) return energy;
  for (const Joint& joint : model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a) {
      const auto& tissue = joint.axes[a].tissue;
      if (!tissue) continue;
      const double stretch = state.q[as_index(joint.first_dof) + a] - tissue->rest;
      energy += 0.5 * tissue->stiffness * stretch * stretch;
    }
  return energy;
}

Momentum momentum(const Model& model, const State& state, std::span<const int> bodies) {
  Momentum out;
  Vec3 first = Vec3::Zero();
  for (const int body : bodies) {
    const double m = model.bodies[as_index(body)].mass;
    const BodyState& s = state.bodies[as_index(body)];
    out.mass += m;
    first += m * s.p;
    out.linear += m * s.v;
  }
  out.centre = first / out.mass;
  for (const int body : bodies) {
    const Body& of = model.bodies[as_index(body)];
    const BodyState& s = state.bodies[as_index(body)];
    out.angular += of.mass * (s.p - out.centre).cross(s.v) + s.q * (of.inertia * (s.q.conjugate() * s.w));
  }
  return out;
}

}  // namespace handsim::model
