#include "handsim/engine/articulated/joint_space.h"

#include <cmath>

namespace handsim::engine::articulated {

namespace {

constexpr int kNone = -1;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

Mat3 cross_matrix(const Vec3& v) {
  Mat3 out;
  out << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return out;
}

Spatial read6(const double (*x)[1]) {
  Spatial out;
  out << x[0][0], x[1][0], x[2][0], x[3][0], x[4][0], x[5][0];
  return out;
}

const Batch<1>* batches(const Tree& tree) { return static_cast<const Batch<1>*>(tree.batch); }
const Frame<1>* bases(const Tree& tree) { return static_cast<const Frame<1>*>(tree.base); }
const Joint3<1>* joints3(const Tree& tree) { return static_cast<const Joint3<1>*>(tree.joint3); }

}  // namespace

JointSpace::JointSpace(Mechanism& mechanism) : mechanism_(mechanism), n_(mechanism.tree().rates) {
  const Topology& topology = mechanism.topology();
  parent_dof_.resize(at(n_));
  node_of_.resize(at(n_));
  H_.resize(at(n_) * at(n_));
  S_.resize(at(n_));
  a_.resize(topology.nodes.size());
  f_.resize(topology.nodes.size());
  composite_.resize(topology.nodes.size());
  for (std::size_t i = 0; i < topology.nodes.size(); ++i) {
    const Node& node = topology.nodes[i];
    first_.push_back(static_cast<int>(mechanism.seat(i).u));
    last_.push_back(first_.back() + rate_count(node.kind) - 1);
    for (int dof = first_.back(); dof <= last_.back(); ++dof) {
      node_of_[at(dof)] = static_cast<int>(i);
      parent_dof_[at(dof)] = dof > first_.back() ? dof - 1 : (node.parent ? last_[at(*node.parent)] : kNone);
    }
  }
}

Spatial JointSpace::axis(int dof) const {
  const int node = node_of_[at(dof)];
  const Batch<1>& b = batches(mechanism_.tree())[node];
  if (rate_count(b.kind) == 1) return read6(b.S);
  return read6(joints3(mechanism_.tree())[b.axis].S[dof - first_[at(node)]]);
}

Spatial JointSpace::velocity(int node) const { return read6(batches(mechanism_.tree())[node].frame.v); }

void JointSpace::inverse_dynamics(std::span<const double> du, std::span<double> tau) {
  const Tree& tree = mechanism_.tree();
  const int nodes = tree.batches;
  for (int dof = 0; dof < n_; ++dof) S_[at(dof)] = axis(dof);
  for (int i = 0; i < nodes; ++i) {
    const Batch<1>& b = batches(tree)[i];
    Spatial& a = a_[at(i)];
    a = b.link == ParentLink::base ? read6(bases(tree)[b.parent].a) : a_[at(b.parent)];
    a += read6(b.c);
    for (int dof = first_[at(i)]; dof <= last_[at(i)]; ++dof) a += du[at(dof)] * S_[at(dof)];
    const Vec3 h(b.h[0][0], b.h[1][0], b.h[2][0]), turn = a.head<3>(), shift = a.tail<3>();
    Mat3 I;
    I << b.I[0][0], b.I[1][0], b.I[2][0], b.I[1][0], b.I[3][0], b.I[4][0], b.I[2][0], b.I[4][0], b.I[5][0];
    Spatial& f = f_[at(i)];
    f = read6(b.pv);
    f.head<3>() += I * turn + h.cross(shift);
    f.tail<3>() += b.mass[0] * shift - h.cross(turn);
  }
  for (int i = nodes - 1; i >= 0; --i) {
    const Batch<1>& b = batches(tree)[i];
    for (int dof = first_[at(i)]; dof <= last_[at(i)]; ++dof) tau[at(dof)] = S_[at(dof)].dot(f_[at(i)]);
    if (b.link != ParentLink::base) f_[at(b.parent)] += f_[at(i)];
  }
}

void JointSpace::find_inertia() {
  const Tree& tree = mechanism_.tree();
  for (int i = 0; i < tree.batches; ++i) {
    const Batch<1>& b = batches(tree)[i];
    const Vec3 h(b.h[0][0], b.h[1][0], b.h[2][0]);
    auto& I = composite_[at(i)];
    I.topLeftCorner<3, 3>() << b.I[0][0], b.I[1][0], b.I[2][0], b.I[1][0], b.I[3][0], b.I[4][0], b.I[2][0],
        b.I[4][0], b.I[5][0];
    I.topRightCorner<3, 3>() = cross_matrix(h);
    I.bottomLeftCorner<3, 3>() = -cross_matrix(h);
    I.bottomRightCorner<3, 3>() = b.mass[0] * Mat3::Identity();
  }
  std::fill(H_.begin(), H_.end(), 0.0);
  for (int i = tree.batches - 1; i >= 0; --i) {
    const Batch<1>& b = batches(tree)[i];
    for (int dof = first_[at(i)]; dof <= last_[at(i)]; ++dof) {
      const Spatial F = composite_[at(i)] * axis(dof);
      for (int j = dof; j != kNone; j = parent_dof_[at(j)]) H_[index(dof, j)] = axis(j).dot(F);
    }
    if (b.link != ParentLink::base) composite_[at(b.parent)] += composite_[at(i)];
  }
}

void JointSpace::factor() {
  for (int k = n_ - 1; k >= 0; --k) {
    const double pivot = std::sqrt(H_[index(k, k)]);
    H_[index(k, k)] = pivot;
    for (int i = parent_dof_[at(k)]; i != kNone; i = parent_dof_[at(i)]) H_[index(k, i)] /= pivot;
    for (int i = parent_dof_[at(k)]; i != kNone; i = parent_dof_[at(i)])
      for (int j = i; j != kNone; j = parent_dof_[at(j)])
        H_[index(i, j)] -= H_[index(k, i)] * H_[index(k, j)];
  }
}

void JointSpace::solve_transposed(std::span<double> x) const {
  for (int i = n_ - 1; i >= 0; --i) {
    x[at(i)] /= H_[index(i, i)];
    for (int j = parent_dof_[at(i)]; j != kNone; j = parent_dof_[at(j)])
      x[at(j)] -= H_[index(i, j)] * x[at(i)];
  }
}

void JointSpace::solve_factor(std::span<double> x) const {
  for (int i = 0; i < n_; ++i) {
    for (int j = parent_dof_[at(i)]; j != kNone; j = parent_dof_[at(j)])
      x[at(i)] -= H_[index(i, j)] * x[at(j)];
    x[at(i)] /= H_[index(i, i)];
  }
}

void JointSpace::add_row(int node, const Spatial& wrench, double sign, std::span<double> out) const {
  for (int dof = last_[at(node)]; dof != kNone; dof = parent_dof_[at(dof)])
    out[at(dof)] += sign * axis(dof).dot(wrench);
}

double JointSpace::row_scale(int node, const Spatial& wrench) const {
  double sum = 0;
  for (int dof = last_[at(node)]; dof != kNone; dof = parent_dof_[at(dof)])
    sum += axis(dof).squaredNorm() / (H_[index(dof, dof)] * H_[index(dof, dof)]);
  return sum * wrench.squaredNorm();
}

Eigen::Matrix3Xd JointSpace::point_jacobian(int node, const Vec3& point) const {
  Eigen::Matrix3Xd out = Eigen::Matrix3Xd::Zero(3, n_);
  for (int dof = last_[at(node)]; dof != kNone; dof = parent_dof_[at(dof)]) {
    const Spatial S = axis(dof);
    out.col(dof) = S.tail<3>() + S.head<3>().cross(point);
  }
  return out;
}

}  // namespace handsim::engine::articulated
