#include "handsim/engine/articulated/momentum.h"

#include <algorithm>
#include <numeric>

#include "handsim/engine/articulated/contact/contact_dynamics.h"

namespace handsim::engine::articulated {

void TreeBodies::add(const Mechanism& mechanism, int node) {
  views_.push_back(&mechanism.view(as_index(node)));
  stride_ = mechanism.stride();
  mass_ += *views_.back()->mass;
}

void TreeBodies::refresh() {
  mass_ = 0;
  for (const NodeView* view : views_) mass_ += *view->mass;
}

/// Sum over all bodies of N numbers that each of them has.
template <std::size_t N>
std::array<double, N> TreeBodies::sum(const double* NodeView::*of) const {
  std::array<double, N> out{};
  for (const NodeView* view : views_) {
    const double* x = view->*of;
    for (std::size_t k = 0; k < N; ++k) out[k] += x[k * stride_];
  }
  return out;
}

Vec3 TreeBodies::moment() const { return read3(sum<3>(&NodeView::h).data(), 1); }
Mat3 TreeBodies::inertia() const { return read_symmetric(sum<6>(&NodeView::I).data(), 1); }
Spatial TreeBodies::momentum() const { return read6(sum<6>(&NodeView::momentum).data(), 1); }
double TreeBodies::kinetic() const { return sum<1>(&NodeView::energy)[0]; }

Spatial TreeBodies::rigid_velocity(const Vec3& h, const Mat3& I, const Spatial& momentum) const {
  const Vec3 c = h / mass_, P = momentum.tail<3>(), L = Vec3(momentum.head<3>()) - c.cross(P);
  const Mat3 own = I - h.dot(c) * Mat3::Identity() + h * c.transpose();
  const Vec3 turn = own.inverse() * L;
  Spatial out;
  out << turn, P / mass_ - turn.cross(c);
  return out;
}

MomentumBalance::MomentumBalance(Mechanism& mechanism) : mechanism_(mechanism), trees_(1) {
  const std::vector<Node>& nodes = mechanism.topology().nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const bool root = nodes[i].kind == NodeKind::free;
    if (root) trees_.push_back({{}, static_cast<int>(i), nodes[i].island});
    tree_of_.push_back(root              ? trees_.size() - 1
                       : nodes[i].parent ? tree_of_[as_index(*nodes[i].parent)]
                                         : kHeld);
    FreeTree& tree = trees_[tree_of_[i]];
    if (nodes[i].body) tree.bodies.add(mechanism, static_cast<int>(i));
    if (tree_of_[i] != kHeld && !root) tree.jointed = jointed_ = true;
  }
  group_.resize(trees_.size());
}

void MomentumBalance::refresh() {
  for (FreeTree& tree : trees_) tree.bodies.refresh();
}

std::size_t MomentumBalance::group(std::size_t tree) {
  while (group_[tree] != tree) tree = group_[tree] = group_[group_[tree]];
  return tree;
}

void MomentumBalance::choose(const ContactDynamics* contacts, bool smooth) {
  for (std::size_t i = 1; i < trees_.size(); ++i) trees_[i].active = trees_[i].jointed || smooth;
  if (contacts && trees_.size() > 2) {
    std::iota(group_.begin(), group_.end(), std::size_t{0});
    contacts->each_impulse([&](int a, int b, const Vec3&, const Vec3&, const Vec3&) {
      group_[group(tree_of(a))] = group(tree_of(b));
    });
    contacts->each_impulse([&](int a, int b, const Vec3&, const Vec3&, const Vec3&) {
      if (group(tree_of(a)) != group(kHeld)) trees_[tree_of(a)].active = trees_[tree_of(b)].active = true;
    });
  }
  active_ = std::ranges::any_of(trees_, [](const FreeTree& tree) { return tree.active; });
}

void MomentumBalance::begin_step(std::span<const BodyForce> forces, const ContactDynamics* contacts,
                                 double step, bool smooth) {
  choose(contacts, smooth);
  if (!active_) return;
  mechanism_.kernel().momenta(mechanism_.tree());
  for (FreeTree& tree : trees_) {
    if (!tree.active) continue;
    const Spatial momentum = tree.bodies.momentum();
    const Vec3 c = tree.bodies.moment() / tree.bodies.mass();
    tree.centre = mechanism_.origin(tree.island) + c;
    tree.linear = momentum.tail<3>();
    tree.angular = momentum.head<3>() - c.cross(tree.linear);
    tree.linear += step * tree.bodies.mass() * mechanism_.gravity();
  }
  for (const BodyForce& each : forces) {
    const int node = mechanism_.topology().node_of_body[as_index(each.body)];
    const Vec3 position = mechanism_.origin(mechanism_.topology().nodes[as_index(node)].island) +
                          read3(mechanism_.view(as_index(node)).p, mechanism_.stride());
    add(node, position, step * each.force, step * each.moment);
  }
  if (contacts)
    contacts->each_impulse([&](int a, int b, const Vec3& point, const Vec3& impulse, const Vec3& moment) {
      add(a, point, impulse, moment);
      add(b, point, -impulse, -moment);
    });
  for (FreeTree& tree : trees_) {
    if (!tree.active) continue;
    tree.centre += step / tree.bodies.mass() * tree.linear;
    if (smooth) tree.centre -= 0.5 * step * step * mechanism_.gravity();
  }
}

void MomentumBalance::add(int node, const Vec3& point, const Vec3& impulse, const Vec3& moment) {
  FreeTree& tree = trees_[tree_of(node)];
  tree.linear += impulse;
  tree.angular += (point - tree.centre).cross(impulse) + moment;
}

bool MomentumBalance::correct(bool sound) {
  if (!active_) return sound;
  mechanism_.kernel().momenta(mechanism_.tree());
  const std::size_t s = mechanism_.stride();
  for (FreeTree& tree : trees_) {
    if (!tree.active) continue;
    const LaneSlot& slot = mechanism_.slot(as_index(tree.root));
    const Vec3 h = tree.bodies.moment(), c = h / tree.bodies.mass();
    Spatial missing;
    missing << tree.angular + c.cross(tree.linear), tree.linear;
    missing -= tree.bodies.momentum();
    const Spatial change = tree.bodies.rigid_velocity(h, tree.bodies.inertia(), missing);
    double *q = &mechanism_.q()[slot.q], *u = &mechanism_.u()[slot.u];
    for (Eigen::Index k = 0; k < 3; ++k) q[as_index(k) * s] = tree.centre[k] - c[k];
    for (Eigen::Index k = 0; k < 6; ++k) u[as_index(k) * s] += change[k];
  }
  return mechanism_.kernel().velocities(mechanism_.tree());
}

}  // namespace handsim::engine::articulated
