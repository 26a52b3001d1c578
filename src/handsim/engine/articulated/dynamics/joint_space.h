// The equation of motion in joint space, H(q) du + C(q, u) = tau (Featherstone 2008, eq. 6.1, p. 101):
// inverse dynamics, H, its sparse factor, Jacobians. For loops and contacts; forward dynamics needs none.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "handsim/engine/articulated/dynamics/mechanism.h"

namespace handsim::engine::articulated {

/// Angular part first, in world axes about the island's origin.
using Spatial = Eigen::Matrix<double, 6, 1>;

/// Every `stride`th number.
inline Spatial read6(const double* x, std::size_t stride) {
  Spatial out;
  for (std::size_t i = 0; i < 6; ++i) out[static_cast<Eigen::Index>(i)] = x[i * stride];
  return out;
}

inline Vec3 read3(const double* x, std::size_t stride) { return {x[0], x[stride], x[2 * stride]}; }

/// A symmetric matrix from its upper triangle, row by row.
inline Mat3 read_symmetric(const double* x, std::size_t s) {
  Mat3 out;
  out << x[0], x[s], x[2 * s], x[s], x[3 * s], x[4 * s], x[2 * s], x[4 * s], x[5 * s];
  return out;
}

inline constexpr int kNoDof = -1;  ///< The parent of a dof that no other one carries.

/// Dynamics of a mechanism in its joint coordinates, at the positions, rates and motions of the bases that
/// its `kinematics` last found. Rates are in the order of the nodes; with one lane that is the order of
/// Mechanism::u().
class JointSpace {
 public:
  /// Memory of the inertia matrix H: no H, one of this object, or one of the thread, which lasts until
  /// another space of the thread calls `compute_inertia`.
  enum class Inertia { none, own, of_thread };
  /// @param mechanism must outlive this object.
  explicit JointSpace(Mechanism& mechanism, Inertia inertia = Inertia::own);
  JointSpace(const JointSpace&) = delete;  ///< H_ points into it
  JointSpace& operator=(const JointSpace&) = delete;

  int size() const { return n_; }
  /// The index of a dof's rate in Mechanism::u() and Mechanism::du().
  std::size_t rate_index(int dof) const { return rate_[as_index(dof)]; }
  int first_dof(int node) const { return first_[as_index(node)]; }
  int last_dof(int node) const { return last_[as_index(node)]; }
  /// The dof that carries this one, or kNoDof.
  int parent_dof(int dof) const { return parent_dof_[as_index(dof)]; }
  /// The motion axis S of a dof.
  Spatial axis(int dof) const { return read6(axis_data(dof), stride_); }
  /// The motion axis of a dof in the mechanism's memory: every Mechanism::stride()'th number.
  const double* axis_data(int dof) const { return axes_[as_index(dof)]; }

  /// Generalised forces tau for given accelerations: recursive Newton-Euler (Featherstone 2008, section 5.3,
  /// Table 5.1, p. 96). Gravity and the bases' accelerations included; leaves each node's acceleration for
  /// `acceleration`.
  void inverse_dynamics(std::span<const double> du, std::span<double> tau);
  /// Computes H by the composite-rigid-body algorithm (Table 6.2, p. 107). @param of says of a dof whether
  /// its tree is to be computed
  template <class Of>
  void compute_inertia(const Of& of) {
    place_inertia();
    if (const double* const entries = compute_in_lanes()) {
      for (std::size_t i = 0; i < views_.size(); ++i)
        if (of(first_[i])) single_body_[i] ? compute_body_inertia(i) : read_inertia(i, entries);
      return;
    }
    for (std::size_t i = 0; i < views_.size(); ++i)
      if (!single_body_[i] && of(first_[i])) start_composite(i);
    for (std::size_t i = views_.size(); i-- > 0;)
      if (of(first_[i])) single_body_[i] ? compute_body_inertia(i) : compute_node_inertia(i);
  }
  void compute_inertia() {
    compute_inertia([](int) { return true; });
  }
  /// Entry (i, j) of H, j <= i; zero where neither dof carries the other.
  double inertia(int i, int j) const { return H_[index(i, j)]; }
  void add_to_diagonal(int i, double weight) { H_[index(i, i)] += weight; }
  /// Adds to entry (i, j) of H, j <= i, where j carries i.
  void add(int i, int j, double value) { H_[index(i, j)] += value; }
  /// Factors H = L^T L in place, without fill-in outside the branches (section 6.5, Table 6.3, p. 114).
  void factor();
  /// x = L^-T x. Followed by `solve_factor`, x = H^-1 x.
  void solve_transposed(std::span<double> x) const;
  /// x = L^-1 x.
  void solve_factor(std::span<double> x) const;

  /// Adds the generalised forces of a wrench on a node: out[i] += sign * S_i . wrench for dofs that carry it.
  void add_row(int node, const Spatial& wrench, double sign, std::span<double> out) const;
  /// A bound, after `factor`, of r H^-1 r^T of the row r that `add_row` makes, over the square of its wrench.
  /// A row far below the bound is zero but for rounding.
  double row_scale(int node) const;
  Spatial velocity(int node) const { return read6(views_[as_index(node)].v, stride_); }
  /// Spatial acceleration of a node, less gravity's, as `inverse_dynamics` last left it.
  Spatial acceleration(int node) const { return a_[as_index(node)]; }

 private:
  void place_inertia();
  void start_composite(std::size_t node);
  void compute_node_inertia(std::size_t node);
  const double* compute_in_lanes() const;
  void read_inertia(std::size_t node, const double* entries);
  void compute_body_inertia(std::size_t node);
  std::size_t index(int i, int j) const { return as_index(i) * as_index(n_) + as_index(j); }

  int n_ = 0;
  std::vector<int> first_, last_;  ///< dofs of each node
  std::vector<int> parent_dof_;    ///< lambda of each dof, or kNoDof
  std::vector<int> parent_node_;
  std::vector<char> single_body_;  ///< of each node: a free body that carries nothing
  std::vector<std::size_t> rate_;
  std::span<const NodeView> views_;
  std::vector<const double*> axes_;  ///< S of each dof
  std::size_t stride_ = 1;
  const Mechanism& mechanism_;
  /// Of each node its first entry as Kernel::inertia writes them, and how many there are; none where a node
  /// of several rates carries another.
  std::vector<std::size_t> entry_;
  std::size_t entries_ = 0;
  Inertia kind_;
  std::vector<double> own_H_;
  double* H_ = nullptr;
  std::vector<Spatial> a_;
  Spatial* S_ = nullptr;  ///< of each dof; of the thread, within `inverse_dynamics` or `compute_inertia`
  /// Mass, its moment and rotational inertia about O of a node and all that it carries.
  struct Composite {
    double mass = 0;
    Vec3 h = Vec3::Zero();
    Mat3 I = Mat3::Zero();
  };
  Composite* composites_ = nullptr;     ///< of the thread, within `compute_inertia`
  std::vector<Spatial>& node_forces();  ///< of the thread, within `inverse_dynamics`
  void place_axes();
};

}  // namespace handsim::engine::articulated
