#include "handsim/engine/articulated/dynamics/topology.h"

#include <algorithm>
#include <numeric>

#include <Eigen/Eigenvalues>

namespace handsim::engine::articulated {

namespace {

Quat pure(const Vec3& v) { return {0, v.x(), v.y(), v.z()}; }

/// Rotation to a body's principal axes, and the moments about them.
struct Principal {
  Quat q_LB = Quat::Identity();
  Vec3 moments = Vec3::Zero();
};

Principal principal(const Mat3& inertia) {
  Principal out;
  out.moments = inertia.diagonal();
  const Mat3 off = inertia - Mat3(inertia.diagonal().asDiagonal());
  if (off.isZero(0)) return out;
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(inertia);
  Mat3 axes = solver.eigenvectors();
  if (axes.determinant() < 0) axes.col(0) = -axes.col(0);
  out.moments = solver.eigenvalues();
  out.q_LB = Quat(Mat3(axes.transpose())).normalized();
  return out;
}

/// Sets of things that are one.
class Unions {
 public:
  explicit Unions(std::size_t size) : root_(size) { std::iota(root_.begin(), root_.end(), 0); }
  int find(int i) const {
    while (root_[as_index(i)] != i) i = root_[as_index(i)];
    return i;
  }
  bool join(int a, int b) {
    a = find(a);
    b = find(b);
    root_[as_index(std::max(a, b))] = std::min(a, b);
    return a != b;
  }

 private:
  std::vector<int> root_;
};

class Builder {
 public:
  explicit Builder(const model::Model& model) : model_(model) {
    for (const model::Body& body : model.bodies) frames_.push_back(principal(body.inertia));
    for (std::size_t i = 0; i < frames_.size(); ++i)
      if (model.bodies[i].kinematic) frames_[i] = {};
    out_.node_of_body.assign(model.bodies.size(), kNoNode);
  }

  Topology run() {
    choose_tree();
    grow();
    sort_by_depth();
    cut();
    number_islands();
    // Thousands of environments have one each.
    out_.nodes.shrink_to_fit();
    return std::move(out_);
  }

 private:
  bool moves(int body) const { return !model_.bodies[as_index(body)].kinematic; }
  /// All kinematic bodies stand for one ground.
  int merged(int body) const { return moves(body) ? body : model::kWorld; }

  static bool has_forces(const model::Joint& joint) {
    return std::ranges::any_of(joint.axes, [](const model::JointAxis& axis) {
      return axis.stop || axis.tissue || axis.torque != 0;
    });
  }

  /// Spanning trees of joints with most constraints: few coordinates, few cut rows. Joints with forces first.
  void choose_tree() {
    std::vector<int> order(model_.joints.size());
    std::iota(order.begin(), order.end(), 0);
    std::ranges::stable_sort(order, [&](int a, int b) {
      const auto rank = [&](int i) {
        const model::Joint& joint = model_.joints[as_index(i)];
        return model::dof_count(joint.kind) - (has_forces(joint) ? 10 : 0);
      };
      return rank(a) < rank(b);
    });
    Unions sets(model_.bodies.size());
    in_tree_.assign(model_.joints.size(), false);
    for (const int i : order) {
      const model::Joint& joint = model_.joints[as_index(i)];
      in_tree_[as_index(i)] = sets.join(merged(joint.parent), merged(joint.child));
    }
  }

  void grow() {
    std::vector<bool> placed(model_.bodies.size());
    std::vector<int> front;
    for (std::size_t i = 0; i < placed.size(); ++i)
      if (!moves(static_cast<int>(i))) {
        placed[i] = true;
        front.push_back(static_cast<int>(i));
      }
    spread(front, placed);
    for (std::size_t i = 0; i < placed.size(); ++i) {
      if (placed[i]) continue;
      add_free(static_cast<int>(i));
      placed[i] = true;
      spread({static_cast<int>(i)}, placed);
    }
  }

  /// Hangs on a front of bodies all that tree joints tie to it.
  void spread(std::vector<int> front, std::vector<bool>& placed) {
    for (std::size_t k = 0; k < front.size(); ++k)
      for (std::size_t i = 0; i < model_.joints.size(); ++i) {
        const model::Joint& joint = model_.joints[i];
        const bool from_parent = joint.parent == front[k];
        const int other = from_parent ? joint.child : joint.parent;
        if (!in_tree_[i] || (!from_parent && joint.child != front[k]) || placed[as_index(other)]) continue;
        add_joint(static_cast<int>(i), !from_parent);
        placed[as_index(other)] = true;
        front.push_back(other);
      }
  }

  void carry(Node& node, int body) {
    const Principal& frame = frames_[as_index(body)];
    node.body = body;
    node.mass = model_.bodies[as_index(body)].mass;
    node.inertia = frame.moments;
    node.q_LB = frame.q_LB;
  }

  void add_free(int body) {
    Node node;
    node.kind = NodeKind::free;
    carry(node, body);
    out_.node_of_body[as_index(body)] = static_cast<int>(out_.nodes.size());
    out_.nodes.push_back(node);
  }

  void add_joint(int index, bool reversed) {
    const model::Joint& joint = model_.joints[as_index(index)];
    const int parent = reversed ? joint.child : joint.parent, child = reversed ? joint.parent : joint.child;
    // F is fixed in the tree's parent, M in its child, whatever the model calls them.
    const Pose x_PF = reversed ? joint.child_frame : joint.parent_frame;
    const Pose x_CM = reversed ? joint.parent_frame : joint.child_frame;
    const double sign = reversed ? -1 : 1;
    const Quat q_LF = frames_[as_index(parent)].q_LB * x_PF.q;
    const Quat q_ML = (frames_[as_index(child)].q_LB * x_CM.q).conjugate();
    Node first;
    first.joint = index;
    first.reversed = reversed;
    first.anchor = frames_[as_index(parent)].q_LB * x_PF.p;
    if (moves(parent)) {
      first.parent = out_.node_of_body[as_index(parent)];
      first.depth = out_.nodes[as_index(*first.parent)].depth + 1;
    }
    first.base = moves(parent) ? model::kWorld : parent;
    // A node for each axis and one for free rotation, in the tree's order.
    const int count = static_cast<int>(joint.axes.size()) + (joint.spherical() ? 1 : 0);
    Node node = first;
    for (int k = 0; k < count; ++k) {
      const bool last = k + 1 == count;
      node.axis_index = reversed ? count - 1 - k : k;
      attach(node, joint, k == 0 ? q_LF : Quat::Identity(), last ? q_ML : Quat::Identity(), sign);
      if (last) break;
      out_.nodes.push_back(node);
      node = first;
      node.parent = static_cast<int>(out_.nodes.size()) - 1;
      node.depth = out_.nodes.back().depth + 1;
      node.base = model::kWorld;
      node.anchor = Vec3::Zero();
    }
    node.arm = -(frames_[as_index(child)].q_LB * x_CM.p);
    carry(node, child);
    out_.node_of_body[as_index(child)] = static_cast<int>(out_.nodes.size());
    out_.nodes.push_back(node);
  }

  /// The transform of one of a joint's nodes, but for the places of its ends.
  static void attach(Node& node, const model::Joint& joint, const Quat& q_LF, const Quat& q_ML, double sign) {
    const auto index = as_index(node.axis_index);
    if (index == joint.axes.size()) {
      node.kind = NodeKind::ball;
      node.before = q_LF;
      node.after = q_ML;
      return;
    }
    const Vec3 axis = sign * joint.axes[index].axis;
    node.before = q_LF * q_ML;
    if (joint.slides(index)) {
      node.kind = NodeKind::prismatic;
      node.axis = q_LF * axis;
      return;
    }
    node.kind = NodeKind::revolute;
    node.turned = q_LF * pure(axis) * q_ML;
    node.axis = q_ML.conjugate() * axis;
  }

  void sort_by_depth() {
    std::vector<int> order(out_.nodes.size()), place(out_.nodes.size());
    std::iota(order.begin(), order.end(), 0);
    std::ranges::stable_sort(
        order, [&](int a, int b) { return out_.nodes[as_index(a)].depth < out_.nodes[as_index(b)].depth; });
    // Kind by kind, in the order of the parents, so that chains keep their lanes from level to level.
    std::vector<Node> sorted;
    for (std::size_t begin = 0; begin < order.size();) {
      std::size_t end = begin;
      while (end < order.size() &&
             out_.nodes[as_index(order[end])].depth == out_.nodes[as_index(order[begin])].depth)
        ++end;
      std::stable_sort(order.begin() + static_cast<std::ptrdiff_t>(begin),
                       order.begin() + static_cast<std::ptrdiff_t>(end), [&](int a, int b) {
                         const Node &p = out_.nodes[as_index(a)], &q = out_.nodes[as_index(b)];
                         if (p.kind != q.kind) return p.kind < q.kind;
                         return (p.parent ? place[as_index(*p.parent)] : -1) <
                                (q.parent ? place[as_index(*q.parent)] : -1);
                       });
      for (std::size_t k = begin; k < end; ++k) place[as_index(order[k])] = static_cast<int>(k);
      begin = end;
    }
    for (const int i : order) {
      sorted.push_back(out_.nodes[as_index(i)]);
      if (sorted.back().parent) sorted.back().parent = place[as_index(*sorted.back().parent)];
    }
    out_.nodes = std::move(sorted);
    for (std::size_t i = 0; i < out_.nodes.size(); ++i)
      if (out_.nodes[i].body) out_.node_of_body[as_index(*out_.nodes[i].body)] = static_cast<int>(i);
  }

  CutSide side(int body, const Pose& frame) const {
    CutSide out;
    const Quat& q_LB = frames_[as_index(body)].q_LB;
    out.frame = {q_LB * frame.p, q_LB * frame.q};
    out.base = body;
    if (moves(body)) out.node = out_.node_of_body[as_index(body)];
    return out;
  }

  void cut() {
    for (std::size_t i = 0; i < model_.joints.size(); ++i) {
      const model::Joint& joint = model_.joints[i];
      if (in_tree_[i] || (!moves(joint.parent) && !moves(joint.child))) continue;
      out_.cuts.push_back({static_cast<int>(i), side(joint.parent, joint.parent_frame),
                           side(joint.child, joint.child_frame), 0});
    }
  }

  void number_islands() {
    Unions sets(out_.nodes.size());
    for (std::size_t i = 0; i < out_.nodes.size(); ++i)
      if (out_.nodes[i].parent) sets.join(static_cast<int>(i), *out_.nodes[i].parent);
    for (const Cut& cut : out_.cuts)
      if (cut.parent.node && cut.child.node) sets.join(*cut.parent.node, *cut.child.node);
    std::vector<int> number(out_.nodes.size(), kNoNode);
    for (std::size_t i = 0; i < out_.nodes.size(); ++i) {
      int& mine = number[as_index(sets.find(static_cast<int>(i)))];
      if (mine == kNoNode) {
        mine = out_.islands++;
        out_.reference.push_back(static_cast<int>(i));
      }
      out_.nodes[i].island = mine;
    }
    for (Cut& cut : out_.cuts)
      cut.island = out_.nodes[as_index(cut.parent.node ? *cut.parent.node : *cut.child.node)].island;
  }

  const model::Model& model_;
  std::vector<Principal> frames_;
  std::vector<bool> in_tree_;
  Topology out_;
};

}  // namespace

Topology make_topology(const model::Model& model) { return Builder(model).run(); }

}  // namespace handsim::engine::articulated
