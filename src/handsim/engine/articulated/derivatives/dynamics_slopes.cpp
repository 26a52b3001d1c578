#include "handsim/engine/articulated/derivatives/dynamics_slopes.h"

namespace handsim::engine::articulated {

Spatial DynamicsSlopes::Body::times(const Spatial& x) const {
  const Vec3 turn = x.head<3>(), shift = x.tail<3>();
  Spatial out;
  out << I * turn + h.cross(shift), mass * shift - h.cross(turn);
  return out;
}

Spatial DynamicsSlopes::Body::times_B(const Spatial& x) const {
  const Vec3 turn = x.head<3>();
  Spatial out;
  out << B * turn, 2 * turn.cross(momentum);
  return out;
}

DynamicsSlopes::DynamicsSlopes(const Mechanism& mechanism)
    : views_(mechanism.views()), stride_(mechanism.stride()) {
  const std::vector<Node>& nodes = mechanism.topology().nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    parent_node_.push_back(nodes[i].parent ? *nodes[i].parent : kNoNode);
    kind_.push_back(nodes[i].kind);
    first_.push_back(size());
    const int count = rate_count(nodes[i].kind);
    for (int k = 0; k < count; ++k) {
      parent_.push_back(k > 0 ? size() - 1 : (nodes[i].parent ? last_[as_index(*nodes[i].parent)] : kNoDof));
      node_.push_back(static_cast<int>(i));
    }
    last_.push_back(size() - 1);
  }
  for (auto* each : {&v_, &before_, &a_}) each->resize(nodes.size());
  bodies_.resize(nodes.size());
  dofs_.resize(node_.size());
  for (auto* each : {&by_q_, &by_u_, &H_}) each->setZero(size(), size());
}

/// Velocities, accelerations and forces, parents first.
void DynamicsSlopes::place(std::span<const double> du, bool moving, const Vec3& gravity) {
  for (std::size_t i = 0; i < views_.size(); ++i) {
    const NodeView& b = views_[i];
    Spatial &v = v_[i], &a = a_[i], own = Spatial::Zero(), change = Spatial::Zero();
    for (int dof = first_[i], k = 0; dof <= last_[i]; ++dof, ++k) {
      dofs_[as_index(dof)].S = read6(b.S + 6 * as_index(k) * stride_, stride_);
      if (!moving) continue;
      own += b.u[as_index(k) * stride_] * dofs_[as_index(dof)].S;
      change += du[as_index(dof)] * dofs_[as_index(dof)].S;
    }
    if (moving) {
      v = read6(b.v, stride_);
      a = (b.base_a ? read6(b.base_a, stride_) : a_[as_index(parent_node_[i])]) + read6(b.c, stride_) +
          change;
    } else {
      v.setZero();
      a << Vec3::Zero(), -gravity;
    }
    before_[i] = v - own;
    Body& body = bodies_[i];
    body.mass = *b.mass;
    body.h = read3(b.h, stride_);
    body.I = read_symmetric(b.I, stride_);
    const Vec3 w = v.head<3>(), s = v.tail<3>();
    body.momentum = body.mass * s + w.cross(body.h);
    body.B = cross_matrix(w) * (2 * body.I - body.I.trace() * Mat3::Identity()) +
             2 * (body.h.dot(s) * Mat3::Identity() - s * body.h.transpose());
    body.force = body.times(a) + cross_force(v, body.times(v));
  }
}

void DynamicsSlopes::find(std::span<const double> du, bool moving, const Vec3& gravity) {
  place(du, moving, gravity);
  for (std::size_t i = views_.size(); i-- > 0;) {
    if (parent_node_[i] == kNoNode) continue;
    Body& to = bodies_[as_index(parent_node_[i])];
    const Body& from = bodies_[i];
    to.mass += from.mass;
    to.h += from.h;
    to.momentum += from.momentum;
    to.I += from.I;
    to.B += from.B;
    to.force += from.force;
  }
  for (int i = 0; i < static_cast<int>(views_.size()); ++i) compute_node(i);
}

/// Rows and columns of a node with those that carry it.
void DynamicsSlopes::compute_node(int node) {
  const Body& body = bodies_[as_index(node)];
  const Spatial &v = v_[as_index(node)], &a = a_[as_index(node)];
  for (int j = first_dof(node); j <= last_dof(node); ++j) {
    Dof& of = dofs_[as_index(j)];
    if (is_shift(j)) {
      of.turned = of.turned_rate = of.driven = Spatial::Zero();
    } else {
      Spatial own = before_[as_index(node)];
      // Turns of a free body are carried by its shifts.
      if (kind(node) == NodeKind::free) own << Vec3::Zero(), v.tail<3>();
      of.turned = cross_motion(v, of.S);
      of.turned_rate = cross_motion(a, of.S) + cross_motion(v, of.turned);
      of.driven = of.turned + cross_motion(own, of.S);
    }
    const Spatial U = body.times(of.S), gain = body.times(of.driven) + body.times_B(of.S);
    Spatial moved = Spatial::Zero();
    if (!is_shift(j))
      moved = cross_force(of.S, body.force) + body.times(of.turned_rate) + body.times_B(of.turned);
    const Vec3 Y = body.B.transpose() * of.S.head<3>() + 2 * body.momentum.cross(Vec3(of.S.tail<3>()));
    for (int k = last_dof(node); k >= first_dof(node); --k) {
      const Spatial& S = dofs_[as_index(k)].S;
      by_q_(k, j) = S.dot(moved);
      by_u_(k, j) = S.dot(gain);
      H_(k, j) = S.dot(U);
    }
    for (int k = parent_dof(first_dof(node)); k != kNoDof; k = parent_dof(k)) {
      const Dof& on = dofs_[as_index(k)];
      by_q_(k, j) = on.S.dot(moved);
      by_u_(k, j) = on.S.dot(gain);
      H_(k, j) = H_(j, k) = on.S.dot(U);
      by_q_(j, k) = U.dot(on.turned_rate) + Y.dot(on.turned.head<3>());
      by_u_(j, k) = U.dot(on.driven) + Y.dot(on.S.head<3>());
    }
  }
}

}  // namespace handsim::engine::articulated
