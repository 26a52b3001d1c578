// Derivatives of inverse dynamics tau(q, u, du) by positions and rates, and the inertia H = d tau / d du, in
// one pass up and one down the tree (Carpentier and Mansard 2018, "Analytical derivatives of rigid body
// dynamics algorithms", RSS; in the closed form of Singh, Russell and Wensing 2022, IEEE RA-L 7(2)).
// A position changes by a vector along the axes of its rates: for balls and free bodies by a rotation vector
// in the axes that their angular velocity has, q' = exp(dq) q.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "handsim/engine/articulated/dynamics/joint_space.h"

namespace handsim::engine::articulated {

/// Spatial motion a x b, and force a x* f (Featherstone 2008, eqs. 2.31 and 2.32, p. 23).
inline Spatial cross_motion(const Spatial& a, const Spatial& b) {
  const Vec3 w = a.head<3>(), v = a.tail<3>(), x = b.head<3>(), y = b.tail<3>();
  Spatial out;
  out << w.cross(x), w.cross(y) + v.cross(x);
  return out;
}
inline Spatial cross_force(const Spatial& a, const Spatial& f) {
  const Vec3 w = a.head<3>(), v = a.tail<3>(), n = f.head<3>(), p = f.tail<3>();
  Spatial out;
  out << w.cross(n) + v.cross(p), w.cross(p);
  return out;
}
/// Spatial velocity at a point from the origin, as angular and linear part there.
inline Spatial at_point(const Spatial& v, const Vec3& r) {
  Spatial out = v;
  out.tail<3>() += Vec3(v.head<3>()).cross(r);
  return out;
}

class DynamicsSlopes {
 public:
  /// @param mechanism must outlive this object. Rates are in the order of the nodes, as JointSpace has them.
  explicit DynamicsSlopes(const Mechanism& mechanism);

  int size() const { return static_cast<int>(node_.size()); }
  /// From where `kinematics` last found the mechanism. @param moving false: at rest, with gravity alone
  /// @param gravity in its place where it does not move
  void find(std::span<const double> du, bool moving = true, const Vec3& gravity = Vec3::Zero());
  /// d tau_i / d q_j, d tau_i / d u_j, and H: zero where neither carries the other.
  const Eigen::MatrixXd& by_position() const { return by_q_; }
  const Eigen::MatrixXd& by_rate() const { return by_u_; }
  const Eigen::MatrixXd& inertia() const { return H_; }

  /// Derivative by gravity of the generalised force that a dof needs for the weight of the bodies that it
  /// carries: d(-tau)/dg [kg m or kg].
  Vec3 carried(int dof) const {
    const Body& of = bodies_[as_index(node(dof))];
    return of.times(axis(dof)).tail<3>();
  }

  int node(int dof) const { return node_[as_index(dof)]; }
  int parent_dof(int dof) const { return parent_[as_index(dof)]; }
  int first_dof(int node) const { return first_[as_index(node)]; }
  int last_dof(int node) const { return last_[as_index(node)]; }
  int parent_node(int node) const { return parent_node_[as_index(node)]; }
  NodeKind kind(int node) const { return kind_[static_cast<std::size_t>(node)]; }
  const Spatial& axis(int dof) const { return dofs_[as_index(dof)].S; }
  /// @returns whether a change of position j moves the axis of rate i; both are of one branch
  bool moves_axis(int j, int i) const { return node(i) != node(j) ? j < i : is_shift(j) && !is_shift(i); }
  /// @returns whether a dof is a coordinate of a free body's position, and not of its turn
  bool is_shift(int dof) const {
    return kind(node(dof)) == NodeKind::free && dof - first_dof(node(dof)) >= 3;
  }

 private:
  /// Sums over a node, and later over all that it carries: mass, its moment h, inertia, momentum, force, and
  /// the rotational block of B, where B x = v x* I x - I (v x x) + x x* I v.
  struct Body {
    double mass = 0;
    Vec3 h = Vec3::Zero(), momentum = Vec3::Zero();
    Mat3 I = Mat3::Zero(), B = Mat3::Zero();
    Spatial force = Spatial::Zero();
    Spatial times(const Spatial& x) const;
    Spatial times_B(const Spatial& x) const;
  };
  /// The axis S of a rate; derivatives of the velocities and accelerations of all that it carries by its
  /// position (Psi and its time derivative), and by the rate.
  struct Dof {
    Spatial S, turned, turned_rate, driven;
  };
  void place(std::span<const double> du, bool moving, const Vec3& gravity);
  void compute_node(int node);

  std::span<const NodeView> views_;
  std::size_t stride_;
  std::vector<int> node_, parent_, first_, last_, parent_node_;
  std::vector<NodeKind> kind_;
  std::vector<Body> bodies_;
  std::vector<Spatial> v_, before_, a_;  ///< of each node; v before its joint
  std::vector<Dof> dofs_;
  Eigen::MatrixXd by_q_, by_u_, H_;
};

}  // namespace handsim::engine::articulated
