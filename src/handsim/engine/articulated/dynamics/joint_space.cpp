#include "handsim/engine/articulated/dynamics/joint_space.h"

#include <cmath>

namespace handsim::engine::articulated {

JointSpace::JointSpace(Mechanism& mechanism, Inertia inertia)
    : views_(mechanism.views()), stride_(mechanism.stride()), mechanism_(mechanism), kind_(inertia) {
  const Topology& topology = mechanism.topology();
  for (std::size_t i = 0; i < topology.nodes.size(); ++i) {
    const Node& node = topology.nodes[i];
    parent_node_.push_back(node.parent ? *node.parent : kNoNode);
    single_body_.push_back(node.kind == NodeKind::free);
    if (node.parent) single_body_[as_index(*node.parent)] = false;
    first_.push_back(n_);
    last_.push_back(n_ + rate_count(node.kind) - 1);
    for (int k = 0; k < rate_count(node.kind); ++k, ++n_) {
      parent_dof_.push_back(k > 0 ? n_ - 1 : (node.parent ? last_[as_index(*node.parent)] : kNoDof));
      rate_.push_back(mechanism.slot(i).u + as_index(k) * stride_);
      // S[column][row] of a node of several rates.
      axes_.push_back(views_[i].S + 6 * as_index(k) * stride_);
    }
  }
  bool single = true;
  for (std::size_t i = 0, begin = 0; i < topology.nodes.size(); ++i) {
    const LaneSlot& slot = mechanism.slot(i);
    single = single && (single_body_[i] || rate_count(topology.nodes[i].kind) == 1);
    if (slot.lane == 0) begin = entries_;
    if (slot.lane == 0 && !single_body_[i]) entries_ += as_index(topology.nodes[i].depth + 1) * stride_;
    entry_.push_back(begin + as_index(slot.lane));
  }
  if (!single) entries_ = 0;
  if (kind_ == Inertia::own) own_H_.resize(as_index(n_) * as_index(n_));
  if (kind_ != Inertia::none) place_inertia();
  place_axes();
  a_.resize(topology.nodes.size());
  node_forces();
}

std::vector<Spatial>& JointSpace::node_forces() {
  thread_local std::vector<Spatial> own;
  if (own.size() < views_.size()) own.resize(views_.size());
  return own;
}

void JointSpace::inverse_dynamics(std::span<const double> du, std::span<double> tau) {
  std::vector<Spatial>& forces = node_forces();
  const int nodes = static_cast<int>(views_.size());
  place_axes();
  for (int dof = 0; dof < n_; ++dof) S_[dof] = axis(dof);
  for (int i = 0; i < nodes; ++i) {
    const NodeView& b = views_[as_index(i)];
    Spatial& a = a_[as_index(i)];
    a = b.base_a ? read6(b.base_a, stride_) : a_[as_index(parent_node_[as_index(i)])];
    a += read6(b.c, stride_);
    for (int dof = first_[as_index(i)]; dof <= last_[as_index(i)]; ++dof) a += du[as_index(dof)] * S_[dof];
    const Vec3 h = read3(b.h, stride_), turn = a.head<3>(), shift = a.tail<3>();
    Spatial& f = forces[as_index(i)];
    f = read6(b.pv, stride_);
    f.head<3>() += read_symmetric(b.I, stride_) * turn + h.cross(shift);
    f.tail<3>() += *b.mass * shift - h.cross(turn);
  }
  for (int i = nodes - 1; i >= 0; --i) {
    for (int dof = first_[as_index(i)]; dof <= last_[as_index(i)]; ++dof)
      tau[as_index(dof)] = S_[dof].dot(forces[as_index(i)]);
    if (parent_node_[as_index(i)] != kNoNode)
      forces[as_index(parent_node_[as_index(i)])] += forces[as_index(i)];
  }
}

void JointSpace::place_axes() {
  thread_local std::vector<Spatial> own;
  if (own.size() < as_index(n_)) own.resize(as_index(n_));
  S_ = own.data();
}

void JointSpace::place_inertia() {
  place_axes();
  thread_local std::vector<double> shared;
  std::vector<double>& H = kind_ == Inertia::own ? own_H_ : shared;
  if (H.size() < as_index(n_) * as_index(n_)) H.resize(as_index(n_) * as_index(n_));
  H_ = H.data();
  thread_local std::vector<Composite> composites;
  if (composites.size() < views_.size()) composites.resize(views_.size());
  composites_ = composites.data();
}

void JointSpace::start_composite(std::size_t node) {
  const NodeView& b = views_[node];
  composites_[node] = {*b.mass, read3(b.h, stride_), read_symmetric(b.I, stride_)};
  for (int dof = first_[node]; dof <= last_[node]; ++dof) S_[dof] = axis(dof);
}

/// The entries of all nodes that are no single bodies, or null where there is no way to find them in lanes.
const double* JointSpace::compute_in_lanes() const {
  if (entries_ == 0) return nullptr;
  thread_local std::vector<double> own;
  if (own.size() < entries_) own.resize(entries_);
  mechanism_.kernel().paired_inertia(mechanism_.tree(), own.data());
  return own.data();
}

void JointSpace::read_inertia(std::size_t node, const double* entries) {
  const int dof = first_[node];
  const double* from = entries + entry_[node];
  for (int j = dof; j != kNoDof; j = parent_dof_[as_index(j)], from += stride_) H_[index(dof, j)] = *from;
}

/// What a node carries has been added to it.
void JointSpace::compute_node_inertia(std::size_t node) {
  const Composite& c = composites_[node];
  for (int dof = first_[node]; dof <= last_[node]; ++dof) {
    const Vec3 turn = S_[dof].head<3>(), shift = S_[dof].tail<3>();
    Spatial F;
    F << c.I * turn + c.h.cross(shift), c.mass * shift - c.h.cross(turn);
    for (int j = dof; j != kNoDof; j = parent_dof_[as_index(j)]) H_[index(dof, j)] = S_[j].dot(F);
  }
  if (parent_node_[node] == kNoNode) return;
  Composite& parent = composites_[parent_node_[node]];
  parent.mass += c.mass;
  parent.h += c.h;
  parent.I += c.I;
}

/// By the world's axes through the centre of mass.
void JointSpace::compute_body_inertia(std::size_t node) {
  const Mat3 I = read_symmetric(views_[node].I, stride_);
  const int first = first_[node];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      if (j <= i) {
        H_[index(first + i, first + j)] = I(i, j);
        H_[index(first + 3 + i, first + 3 + j)] = i == j ? *views_[node].mass : 0;
      }
      H_[index(first + 3 + i, first + j)] = 0;
    }
}

void JointSpace::factor() {
  for (int k = n_ - 1; k >= 0; --k) {
    const double pivot = std::sqrt(H_[index(k, k)]);
    H_[index(k, k)] = pivot;
    for (int i = parent_dof_[as_index(k)]; i != kNoDof; i = parent_dof_[as_index(i)])
      H_[index(k, i)] /= pivot;
    for (int i = parent_dof_[as_index(k)]; i != kNoDof; i = parent_dof_[as_index(i)])
      for (int j = i; j != kNoDof; j = parent_dof_[as_index(j)])
        H_[index(i, j)] -= H_[index(k, i)] * H_[index(k, j)];
  }
}

void JointSpace::solve_transposed(std::span<double> x) const {
  for (int i = n_ - 1; i >= 0; --i) {
    x[as_index(i)] /= H_[index(i, i)];
    for (int j = parent_dof_[as_index(i)]; j != kNoDof; j = parent_dof_[as_index(j)])
      x[as_index(j)] -= H_[index(i, j)] * x[as_index(i)];
  }
}

void JointSpace::solve_factor(std::span<double> x) const {
  for (int i = 0; i < n_; ++i) {
    for (int j = parent_dof_[as_index(i)]; j != kNoDof; j = parent_dof_[as_index(j)])
      x[as_index(i)] -= H_[index(i, j)] * x[as_index(j)];
    x[as_index(i)] /= H_[index(i, i)];
  }
}

void JointSpace::add_row(int node, const Spatial& wrench, double sign, std::span<double> out) const {
  for (int dof = last_[as_index(node)]; dof != kNoDof; dof = parent_dof_[as_index(dof)])
    out[as_index(dof)] += sign * axis(dof).dot(wrench);
}

double JointSpace::row_scale(int node) const {
  double sum = 0;
  for (int dof = last_[as_index(node)]; dof != kNoDof; dof = parent_dof_[as_index(dof)])
    sum += axis(dof).squaredNorm() / (H_[index(dof, dof)] * H_[index(dof, dof)]);
  return sum;
}

}  // namespace handsim::engine::articulated
