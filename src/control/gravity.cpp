#include "handsim/control/gravity.h"

namespace handsim::control {

GravityLoad::GravityLoad(const model::Model& model, const Vec3& gravity)
    : model_(model),
      gravity_(gravity),
      moments_(model.bodies.size(), Vec3::Zero()),
      torques_(static_cast<std::size_t>(model.dof_count()), 0.0) {
  std::vector<double> distal_mass;
  std::vector<bool> is_child(model.bodies.size(), false);
  for (const model::Body& body : model.bodies) distal_mass.push_back(body.mass);
  for (const model::Joint& joint : model.joints)
    if (!joint.closes_loop) is_child[static_cast<std::size_t>(joint.child)] = true;
  // Parents come before children: the reverse order sums from the fingertips.
  for (std::size_t j = model.joints.size(); j-- > 0;) {
    const model::Joint& joint = model.joints[j];
    if (joint.closes_loop) continue;
    Link link;
    link.joint = &joint;
    link.parent = static_cast<std::size_t>(joint.parent);
    link.child = static_cast<std::size_t>(joint.child);
    link.dof = static_cast<std::size_t>(joint.first_dof);
    link.mass = distal_mass[link.child];
    link.adds_to_parent = is_child[link.parent];
    link.universal = joint.kind == model::JointKind::universal;
    if (!joint.axes.empty()) link.first_axis = joint.parent_frame.q * joint.axes[0].axis;
    if (link.universal) link.second_axis = joint.child_frame.q * joint.axes[1].axis;
    distal_mass[link.parent] += link.mass;
    links_.push_back(link);
  }
}

std::span<const double> GravityLoad::torques(const model::State& state) {
  for (const Link& link : links_) {
    const model::BodyState& child = state.bodies[link.child];
    moments_[link.child] = model_.bodies[link.child].mass * child.p;
  }
  for (const Link& link : links_) {
    const model::BodyState& child = state.bodies[link.child];
    const Vec3 moment = moments_[link.child];
    if (link.adds_to_parent) moments_[link.parent] += moment;
    if (link.joint->kind != model::JointKind::hinge && !link.universal) continue;
    const Vec3 anchor = child.p + child.q * link.joint->child_frame.p;
    const Vec3 torque = (moment - link.mass * anchor).cross(gravity_);
    torques_[link.dof] = -torque.dot(state.bodies[link.parent].q * link.first_axis);
    if (link.universal) torques_[link.dof + 1] = -torque.dot(child.q * link.second_axis);
  }
  return torques_;
}

}  // namespace handsim::control
