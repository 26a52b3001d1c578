#include "handsim/model/newton_euler.h"

#include <algorithm>

#include "handsim/core/error.h"
#include "handsim/model/kinematics.h"

namespace handsim::model {

namespace {

/// Motion of a driven body by central differences, because tables have no accelerations of their own. At the
/// ends of its keyframes they are taken a little inside: beyond, the frame is at rest, and the difference
/// would be a jolt.
BodyMotion driven(const Drive& drive, double time) {
  constexpr double kSpan = 2e-3;  // [s]
  const double first = drive.motion.keys.front().time, last = drive.motion.keys.back().time;
  const bool inside =
      time >= first && time <= last && last - first > 2 * kSpan && drive.motion.shakes.empty();
  const double middle = inside ? std::clamp(time, first + kSpan, last - kSpan) : time, ahead = time - middle;
  const auto pose = [&](double t) { return drive.motion.at(t) * drive.frame.inverse(); };
  const Pose before = pose(middle - kSpan), there = pose(middle), after = pose(middle + kSpan),
             now = pose(time);
  const Vec3 turned = rotation_vector(there.q * before.q.conjugate()) / kSpan;
  const Vec3 turns = rotation_vector(after.q * there.q.conjugate()) / kSpan;
  const Vec3 a = (after.p - 2 * there.p + before.p) / (kSpan * kSpan), alpha = (turns - turned) / kSpan;
  return {
      {now.p, now.q, (after.p - before.p) / (2 * kSpan) + ahead * a, 0.5 * (turned + turns) + ahead * alpha},
      a,
      alpha};
}

}  // namespace

NewtonEuler::NewtonEuler(const Model& model, const Vec3& gravity)
    : model_(model),
      gravity_(gravity),
      bodies_(model.bodies.size()),
      sums_(model.bodies.size()),
      reactions_(model.joints.size()),
      torques_(as_index(model.dof_count())) {
  for (const Joint& joint : model.joints)
    if (joint.closes_loop)
      throw input_error("inverse dynamics", joint.name + ", a joint that closes a loop",
                        "a model without loops");
}

void NewtonEuler::set_roots(const State& state, double time) {
  for (std::size_t i = 0; i < bodies_.size(); ++i) bodies_[i] = {state.bodies[i]};
  for (const Drive& drive : model_.drives) bodies_[as_index(drive.body)] = driven(drive, time);
}

// With the parent's w, the rates u along axes s_k and anchor A: w_c = w + sum s_k u_k,
// alpha_c = alpha + sum (s_k u'_k + s_k' u_k), where s_0' = w x s_0 and s_1' = w_c x s_1.
void NewtonEuler::place_child(const Joint& joint, std::span<const double> q, std::span<const double> u,
                              std::span<const double> change) {
  const BodyMotion& parent = bodies_[as_index(joint.parent)];
  BodyMotion& child = bodies_[as_index(joint.child)];
  const Pose pose =
      parent.pose() * joint.parent_frame * joint_transform(joint, q) * joint.child_frame.inverse();
  child.p = pose.p;
  child.q = pose.q;
  const Vec3 anchor = pose * joint.child_frame.p, from_parent = anchor - parent.p;
  child.w = parent.w;
  child.alpha = parent.alpha;
  Vec3 v = parent.v + parent.w.cross(from_parent);
  Vec3 a = parent.a + parent.alpha.cross(from_parent) + parent.w.cross(parent.w.cross(from_parent));
  for (std::size_t k = 0; k < joint.axes.size(); ++k) {
    const Vec3 axis = axis_in_world(joint, k, parent.q, child.q);
    const Vec3 before = child.w;
    if (joint.slides(k)) {
      v += axis * u[k];
      a += axis * change[k] + 2 * before.cross(axis * u[k]);
    } else {
      child.w += axis * u[k];
      child.alpha += axis * change[k] + before.cross(axis * u[k]);
    }
  }
  if (joint.spherical()) {
    const Quat frame = parent.q * joint.parent_frame.q;
    const std::size_t k = joint.axes.size();
    const Vec3 relative = frame * Vec3(u[k], u[k + 1], u[k + 2]);
    child.w += relative;
    child.alpha += frame * Vec3(change[k], change[k + 1], change[k + 2]) + parent.w.cross(relative);
  }
  const Vec3 arm = child.p - anchor;
  child.v = v + child.w.cross(arm);
  child.a = a + child.alpha.cross(arm) + child.w.cross(child.w.cross(arm));
}

void NewtonEuler::place(std::span<const double> q, std::span<const double> u,
                        std::span<const double> change) {
  for (const Joint& joint : model_.joints) {
    const std::size_t first = as_index(joint.first_dof);
    place_child(joint, q.subspan(first), u.subspan(first), change.subspan(first));
  }
}

void NewtonEuler::place(const State& from, const State& to) {
  const double step = to.time - from.time;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const BodyState &a = from.bodies[i], &b = to.bodies[i];
    bodies_[i] = {b, (b.v - a.v) / step, (b.w - a.w) / step};
  }
}

std::span<const double> NewtonEuler::torques(std::span<const Wrench> loads) {
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const BodyMotion& body = bodies_[i];
    const Mat3 rotation = body.q.toRotationMatrix();
    const Mat3 inertia = rotation * model_.bodies[i].inertia * rotation.transpose();
    sums_[i].force = model_.bodies[i].mass * (body.a - gravity_);
    sums_[i].moment = inertia * body.alpha + body.w.cross(inertia * body.w);
    if (loads.empty()) continue;
    sums_[i].force -= loads[i].force;
    sums_[i].moment -= loads[i].moment;
  }
  // Parents stand before children: the reverse order sums from the fingertips.
  for (std::size_t j = model_.joints.size(); j-- > 0;) {
    const Joint& joint = model_.joints[j];
    const BodyMotion &parent = bodies_[as_index(joint.parent)], &child = bodies_[as_index(joint.child)];
    const Wrench& sum = sums_[as_index(joint.child)];
    const Vec3 anchor = child.pose() * joint.child_frame.p;
    Wrench& reaction = reactions_[j];
    reaction.force = sum.force;
    reaction.moment = sum.moment + (child.p - anchor).cross(sum.force);
    Wrench& onto = sums_[as_index(joint.parent)];
    onto.force += reaction.force;
    onto.moment += reaction.moment + (anchor - parent.p).cross(reaction.force);
    const std::size_t first = as_index(joint.first_dof);
    for (std::size_t k = 0; k < joint.axes.size(); ++k)
      torques_[first + k] = (joint.slides(k) ? reaction.force : reaction.moment)
                                .dot(axis_in_world(joint, k, parent.q, child.q));
    if (joint.spherical())
      Eigen::Map<Vec3>(torques_.data() + first + joint.axes.size()) =
          (parent.q * joint.parent_frame.q).conjugate() * reaction.moment;
  }
  return torques_;
}

std::vector<double> inverse_dynamics(const Model& model, const State& state, std::span<const double> change,
                                     const Vec3& gravity) {
  NewtonEuler dynamics(model, gravity);
  dynamics.set_roots(state, state.time);
  dynamics.place(state.q, state.u, change);
  const std::span<const double> torques = dynamics.torques();
  return {torques.begin(), torques.end()};
}

}  // namespace handsim::model
