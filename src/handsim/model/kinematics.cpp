#include "handsim/model/kinematics.h"

#include <cmath>

#include "handsim/model/muscle_curves.h"

namespace handsim::model {

namespace {

/// Angle [rad] of a rotation about a given unit axis.
double angle_about(const Quat& q, const Vec3& axis) {
  const double angle = 2.0 * std::atan2(q.vec().dot(axis), q.w());
  // Twice atan2 is in (-2 pi, 2 pi].
  if (angle > M_PI) return angle - 2 * M_PI;
  return angle <= -M_PI ? angle + 2 * M_PI : angle;
}

Pose frame_in_world(const State& state, int body, const Pose& frame) {
  return state.bodies[as_index(body)].pose() * frame;
}

/// X_FM.
Pose relative_pose(const Joint& joint, const State& state) {
  return frame_in_world(state, joint.parent, joint.parent_frame).inverse() *
         frame_in_world(state, joint.child, joint.child_frame);
}

/// Coordinates of R_FM = Rot(a, q0) Rot(b, q1) with a perpendicular to b: with c = a x b,
/// R b = cos q0 b + sin q0 c and R^T a = cos q1 a + sin q1 c.
void universal_angles(const Quat& q_FM, const Vec3& a, const Vec3& b, std::span<double> out) {
  const Vec3 c = a.cross(b);
  const Vec3 b_F = q_FM * b;
  const Vec3 a_M = q_FM.conjugate() * a;
  out[0] = std::atan2(b_F.dot(c), b_F.dot(b));
  out[1] = std::atan2(a_M.dot(c), a_M.dot(a));
}

void set_pose(State& state, int body, const Pose& x_WB) {
  BodyState& target = state.bodies[as_index(body)];
  target.p = x_WB.p;
  target.q = x_WB.q;
}

State zero_state(const Model& model) {
  State state;
  state.bodies.resize(model.bodies.size());
  state.tau.resize(as_index(model.dof_count()));
  state.tau_servo.resize(state.tau.size());
  state.activation.resize(model.muscles.size());
  state.fibre_length.resize(model.muscles.size());
  state.bridge_stretch.resize(model.muscles.size());
  state.fibre_speed.resize(model.muscles.size());
  state.tendon_force.resize(model.muscles.size());
  for (std::size_t i = 0; i < model.bodies.size(); ++i)
    set_pose(state, static_cast<int>(i), model.bodies[i].zero_pose);
  return state;
}

}  // namespace

void joint_coordinates(const Joint& joint, const State& state, std::span<double> out) {
  const Pose x_FM = relative_pose(joint, state);
  const auto slides = as_index(joint.type().slides);
  if (slides > 0) out[0] = x_FM.p.dot(joint.axes[0].axis);
  const std::span<double> angles = out.subspan(slides);
  if (joint.type().turns == 1) angles[0] = angle_about(x_FM.q, joint.axes[slides].axis);
  if (joint.type().turns == 2)
    universal_angles(x_FM.q, joint.axes[slides].axis, joint.axes[slides + 1].axis, angles);
  if (joint.spherical()) Eigen::Map<Vec3>(angles.data()) = rotation_vector(x_FM.q);
}

void joint_rates(const Joint& joint, const State& state, std::span<double> out) {
  const BodyState& parent = state.bodies[as_index(joint.parent)];
  const BodyState& child = state.bodies[as_index(joint.child)];
  const Quat q_WF = parent.q * joint.parent_frame.q;
  const Vec3 w_F = q_WF.conjugate() * (child.w - parent.w);
  const auto slides = as_index(joint.type().slides);
  if (slides > 0) {
    const Vec3 r_child = child.q * joint.child_frame.p;
    // Velocity of M's origin relative to the parent.
    const Vec3 anchor = child.p + r_child;
    const Vec3 v_parent = parent.v + parent.w.cross(anchor - parent.p);
    const Vec3 v = child.v + child.w.cross(r_child) - v_parent;
    out[0] = (q_WF.conjugate() * v).dot(joint.axes[0].axis);
  }
  const std::span<double> rates = out.subspan(slides);
  if (joint.spherical()) {
    Eigen::Map<Vec3>(rates.data()) = w_F;
    return;
  }
  if (joint.type().turns > 0) rates[0] = w_F.dot(joint.axes[slides].axis);
  if (joint.type().turns == 2) {
    // w = q0' a + q1' b_F with a and b_F perpendicular.
    const Quat q_WM = child.q * joint.child_frame.q;
    const Vec3 b_F = q_WF.conjugate() * (q_WM * joint.axes[slides + 1].axis);
    rates[1] = w_F.dot(b_F);
  }
}

void update_coordinates(const Model& model, State& state) {
  state.q.resize(as_index(model.dof_count()));
  state.u.resize(state.q.size());
  for (const Joint& joint : model.joints) {
    const auto first = as_index(joint.first_dof);
    joint_coordinates(joint, state, std::span(state.q).subspan(first));
    joint_rates(joint, state, std::span(state.u).subspan(first));
  }
}

double joint_gap(const Joint& joint, const State& state) {
  const BodyState& parent = state.bodies[as_index(joint.parent)];
  const BodyState& child = state.bodies[as_index(joint.child)];
  Vec3 gap = child.p + child.q * joint.child_frame.p - parent.p - parent.q * joint.parent_frame.p;
  if (joint.slides(0)) {
    const Vec3 axis = parent.q * (joint.parent_frame.q * joint.axes[0].axis);
    gap -= gap.dot(axis) * axis;
  }
  return gap.norm();
}

Vec3 axis_in_world(const Joint& joint, std::size_t axis, const Quat& parent, const Quat& child) {
  return axis <= as_index(joint.type().slides) ? parent * (joint.parent_frame.q * joint.axes[axis].axis)
                                               : child * (joint.child_frame.q * joint.axes[axis].axis);
}

Pose joint_transform(const Joint& joint, std::span<const double> q) {
  Pose x_FM;
  const auto slides = as_index(joint.type().slides);
  if (slides > 0) x_FM.p = q[0] * joint.axes[0].axis;
  const auto turn = [&](std::size_t axis) { return rotation_quaternion(q[axis] * joint.axes[axis].axis); };
  if (joint.type().turns == 1) x_FM.q = turn(slides);
  if (joint.type().turns == 2) x_FM.q = turn(slides) * turn(slides + 1);
  if (joint.spherical()) x_FM.q = rotation_quaternion({q[slides], q[slides + 1], q[slides + 2]});
  return x_FM;
}

void place_children(const Model& model, std::span<const double> q, State& state) {
  for (const Joint& joint : model.joints) {
    if (joint.closes_loop) continue;
    const Pose x_FM = joint_transform(joint, q.subspan(as_index(joint.first_dof)));
    set_pose(state, joint.child,
             frame_in_world(state, joint.parent, joint.parent_frame) * x_FM * joint.child_frame.inverse());
  }
}

void place_joints(const Model& model, std::span<const double> q, std::span<const double> u, State& state) {
  place_children(model, q, state);
  for (const Joint& joint : model.joints) {
    if (joint.closes_loop) continue;
    const auto rates = u.subspan(as_index(joint.first_dof));
    const BodyState& parent = state.bodies[as_index(joint.parent)];
    BodyState& child = state.bodies[as_index(joint.child)];
    const Vec3 anchor = child.p + child.q * joint.child_frame.p;
    Vec3 w = Vec3::Zero(), v = Vec3::Zero();  // of M against F
    for (std::size_t k = 0; k < joint.axes.size(); ++k)
      (joint.slides(k) ? v : w) += rates[k] * axis_in_world(joint, k, parent.q, child.q);
    if (joint.spherical())
      w = parent.q * (joint.parent_frame.q * Eigen::Map<const Vec3>(rates.data() + joint.type().slides));
    child.w = parent.w + w;
    child.v = parent.v + parent.w.cross(anchor - parent.p) + v + child.w.cross(child.p - anchor);
  }
  update_coordinates(model, state);
  rest_muscles(model, state);
}

void rest_muscles(const Model& model, State& state) {
  for (std::size_t i = 0; i < model.muscles.size(); ++i) {
    const Muscle& muscle = model.muscles[i];
    const auto rest = at_rest(muscle, path_state(muscle.path, state.q).excursion, state.activation[i]);
    state.fibre_length[i] = rest.fibre_length;
    state.fibre_speed[i] = 0;
    state.bridge_stretch[i] = 0;
    state.tendon_force[i] = rest.force;
  }
}

State state_at(const Model& model, std::span<const double> q) {
  State state = zero_state(model);
  place_children(model, q, state);
  update_coordinates(model, state);
  rest_muscles(model, state);
  return state;
}

State initial_state(const Model& model) {
  std::vector<double> q(as_index(model.dof_count()), 0.0);
  for (const Joint& joint : model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      q[as_index(joint.first_dof) + a] = joint.axes[a].initial;
  State state = zero_state(model);
  for (const Drive& drive : model.drives)
    set_pose(state, drive.body, drive.motion.at(0) * drive.frame.inverse());
  place_children(model, q, state);
  for (std::size_t i = 0; i < model.bodies.size(); ++i) {
    state.bodies[i].v = model.bodies[i].initial_velocity;
    state.bodies[i].w = model.bodies[i].initial_angular_velocity;
  }
  update_coordinates(model, state);
  for (std::size_t i = 0; i < model.muscles.size(); ++i) state.activation[i] = model.muscles[i].initial;
  rest_muscles(model, state);
  return state;
}

std::vector<int> free_bodies(const Model& model) {
  std::vector<bool> held(model.bodies.size(), false);
  for (const Joint& joint : model.joints) held[as_index(joint.child)] = true;
  std::vector<int> out;
  for (std::size_t i = 0; i < held.size(); ++i)
    if (!held[i] && !model.bodies[i].kinematic) out.push_back(static_cast<int>(i));
  return out;
}

Jacobian jacobian(const Model& model, const State& state, int body, const Vec3& point,
                  std::span<const int> free) {
  const Eigen::Index dofs = model.dof_count();
  Jacobian out = Jacobian::Zero(6, dofs + 6 * static_cast<Eigen::Index>(free.size()));
  // Parents come before children: in the reverse order the joints on the way to the root follow each other.
  for (auto joint = model.joints.rbegin(); joint != model.joints.rend(); ++joint) {
    if (joint->child != body || joint->closes_loop) continue;
    body = joint->parent;
    const BodyState &parent = state.bodies[as_index(joint->parent)],
                    &child = state.bodies[as_index(joint->child)];
    const Vec3 arm = point - child.pose() * joint->child_frame.p;
    Eigen::Index column = joint->first_dof;
    const auto add_turn = [&](const Vec3& axis) { out.col(column++) << axis.cross(arm), axis; };
    for (std::size_t k = 0; k < joint->axes.size(); ++k) {
      const Vec3 axis = axis_in_world(*joint, k, parent.q, child.q);
      if (joint->slides(k))
        out.col(column++) << axis, Vec3::Zero();
      else
        add_turn(axis);
    }
    if (joint->spherical())
      for (int k = 0; k < 3; ++k) add_turn(parent.q * (joint->parent_frame.q * Vec3::Unit(k)));
  }
  for (std::size_t i = 0; i < free.size(); ++i) {
    if (free[i] != body) continue;
    auto columns = out.middleCols<6>(dofs + 6 * static_cast<Eigen::Index>(i));
    columns.setIdentity();
    for (int k = 0; k < 3; ++k)
      columns.block<3, 1>(0, 3 + k) = Vec3::Unit(k).cross(point - state.bodies[as_index(body)].p);
  }
  return out;
}

Eigen::MatrixXd mass_matrix(const Model& model, const State& state, std::span<const int> bodies,
                            std::span<const int> free) {
  const Eigen::Index size = model.dof_count() + 6 * static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(size, size);
  for (const int body : bodies) {
    const Body& of = model.bodies[as_index(body)];
    if (of.kinematic) continue;
    const Jacobian J = jacobian(model, state, body, state.bodies[as_index(body)].p, free);
    const Mat3 rotation = state.bodies[as_index(body)].q.toRotationMatrix();
    Eigen::Matrix<double, 6, 6> spatial = Eigen::Matrix<double, 6, 6>::Zero();
    spatial.topLeftCorner<3, 3>() = of.mass * Mat3::Identity();
    spatial.bottomRightCorner<3, 3>() = rotation * of.inertia * rotation.transpose();
    out += J.transpose() * spatial * J;
  }
  return out;
}

}  // namespace handsim::model
