// Muscles and bands in the step of a mechanism. Their torques at the step's end couple the coordinates
// that a tendon crosses (engine/muscles.h): H becomes H + h B. All coordinates of a tendon lie on one branch,
// so that the factor of H + h B has the same zeros as that of H. The kernels' own solution knows of no B: it
// is corrected by one factorisation of the trees that have tendons (tendon_solution.cpp).
#pragma once

#include <span>
#include <vector>

#include "handsim/engine/articulated/dynamics/joint_space.h"
#include "handsim/engine/muscles.h"

namespace handsim::engine::articulated {

/// The tendons of a mechanism: their torques, and their stiffness B, which joins the inertia.
class MuscleCoupling {
 public:
  /// All arguments must outlive this object.
  MuscleCoupling(const model::Model& model, const Settings& settings, Mechanism& mechanism);

  bool empty() const { return muscles_.empty(); }
  void reset(const model::State& state) { muscles_.reset(state); }
  /// Computes the tensions of a step that starts where `kinematics` last found the mechanism.
  /// @return the step's plain torques and those of the tendons at its start, by Model::dof_count()
  std::span<const double> begin_step(const StepInput& input);
  /// The same for given coordinates and rates, each of size Model::dof_count().
  std::span<const double> begin_step(std::span<const double> q, std::span<const double> u,
                                     const StepInput& input);
  /// Undoes the last `begin_step`, at most once, where its step was not made.
  void restore_step() { muscles_.restore_step(); }
  /// Changes the accelerations that the kernel found, and the reactions of its locked coordinates, to those
  /// of an inertia with h B.
  void correct(double step);
  /// Adds h B to an inertia of the same mechanism.
  template <class Of>
  void add_to(JointSpace& space, double step, const Of& of) const {
    for (std::size_t k = 0; k < entries_.size(); ++k) {
      const auto [i, j] = space_dofs_[k];
      if (of(i)) space.add(i, j, step * slope_[k]);
    }
  }
  /// Calls f(i, j, entry of B) with dofs of the joint space, j carries i or is i.
  template <class F>
  void each_slope(const F& f) const {
    for (std::size_t k = 0; k < entries_.size(); ++k)
      f(space_dofs_[k].first, space_dofs_[k].second, slope_[k]);
  }
  /// @returns whether a tendon crosses a coordinate of the model
  bool pulls(std::size_t dof) const;
  /// Removes h B du from the torques that the kernel's `compute_torques` or `advance` wrote.
  void correct_torques(double step);
  /// Writes activations, fibre lengths and tensions.
  void store_state(model::State& state) const { muscles_.store_state(state.q, state.u, state); }

 private:
  /// A coordinate of a tree with tendons. Its row of H has the coordinates that carry it, from the tree's
  /// first one on, and itself.
  struct Coupled {
    int dof = 0, node = 0;  ///< of the joint space, of the topology
    int depth = 0;          ///< coordinates that carry it
    int row = 0;            ///< first number of its row of H
    double *du = nullptr, *tau = nullptr, *force = nullptr, *reaction = nullptr;
    const double *weight = nullptr, *side = nullptr;  ///< as in Axis
    bool locked() const { return *side * *side > 0; }
  };
  /// An entry of B at coordinate i, carried by j, and its place in the rows of H.
  struct Entry {
    int i = 0, j = 0, at = 0;
    std::size_t slope = 0;  ///< of muscles_
  };
  void collect_trees();
  void collect_entries();
  void collect_sources();
  bool on_one_branch(int a, int b) const;
  void compute_inertia();
  void assemble(double step);
  void lock();
  void solve(bool locks);

  Mechanism& mechanism_;
  JointSpace space_;
  std::vector<int> space_dof_;  ///< of the joint space, of each coordinate of the model, or kNoDof
  Muscles muscles_;
  std::vector<char> with_tendons_;  ///< by dof of the joint space: its tree has some
  std::vector<Coupled> rows_;
  std::vector<Entry> entries_;
  std::vector<std::pair<int, int>> space_dofs_;  ///< of each entry of B, in the joint space
  std::vector<double> slope_;                    ///< B, by entry
  std::vector<int> carrier_;                     ///< coordinate of each number of H
  std::vector<int> from_;                        ///< its place in inertia_
  std::vector<double> inertia_;                  ///< as Kernel::inertia writes it
  std::vector<double> A_, L_;                    ///< numbers of H
  std::vector<double> x_, b_, inverse_;          ///< by coordinate
  double unused_ = 0;  ///< force and reaction of coordinates of nodes of several rates
  bool single_ = true;
  bool have_inertia_ = false;
  std::vector<const double*> q_at_, u_at_;  ///< by Model::dof_count(); null: not a single coordinate
  std::vector<double> q_, u_, given_;
};

}  // namespace handsim::engine::articulated
