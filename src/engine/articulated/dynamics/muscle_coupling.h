// Muscles and ligaments in the step of a mechanism. Their torques at the step's end couple the coordinates
// that a tendon crosses (engine/muscles.h): H becomes H + h B. All coordinates of a tendon lie on one branch,
// so that the factor of H + h B has the same zeros as that of H. The kernels' own solution knows of no B: it
// is corrected here by one factorisation of the trees that have tendons.
#pragma once

#include <span>
#include <vector>

#include "handsim/engine/articulated/dynamics/joint_space.h"
#include "handsim/engine/muscles.h"

namespace handsim::engine::articulated {

class MuscleCoupling {
 public:
  /// All must outlive this.
  MuscleCoupling(const model::Model& model, const Settings& settings, Mechanism& mechanism);

  bool empty() const { return muscles_.empty(); }
  void start(const model::State& state) { muscles_.start(state); }
  /// Tensions of the step from where `kinematics` last found the mechanism.
  /// @return the step's plain torques and those of the tendons at its start, by Model::dof_count()
  std::span<const double> begin(const StepInput& input);
  /// Changes the accelerations that the kernel found, and the reactions of its locks, to those with h B.
  void correct(double step);
  /// Adds h B to an inertia of the same mechanism.
  template <class Of>
  void add_to(JointSpace& space, double step, const Of& of) const {
    for (const Entry& each : entries_)
      if (of(each.dof_i)) space.add(each.dof_i, each.dof_j, step * slopes()[each.slope].value);
  }
  /// Removes h B du from the torques that `find_torques` wrote.
  void find_torques(double step);
  /// Writes activations, fibre lengths and tensions.
  void give(model::State& state) const { muscles_.end(state.q, state.u, state); }

 private:
  /// An entry of B: places among `dofs_` and in the rows of H, and coordinates of the joint space, i carried
  /// by j.
  struct Entry {
    int i = 0, j = 0, dof_i = 0, dof_j = 0;
    std::size_t slope = 0, at = 0;
    std::size_t rate_i = 0, rate_j = 0;
  };
  std::span<const Muscles::Slope> slopes() const { return muscles_.slopes(); }
  void find_trees(const Mechanism& mechanism);
  void find_entries();
  void find_sources();
  void find_inertia();
  bool on_one_branch(int a, int b) const;
  void assemble(double step);
  void solve();

  Mechanism& mechanism_;
  JointSpace space_;
  std::vector<int> space_dof_;  ///< of the joint space, of each coordinate of the model, or kNoDof
  Muscles muscles_;
  std::vector<char> with_tendons_;  ///< by dof of the joint space: its tree has some
  /// A coordinate of a tree with tendons. Its row of H has the coordinates that carry it, from the tree's
  /// first one on, and itself: `depth` + 1 entries from `row`.
  struct Dof {
    int dof = 0, parent = kNoDof;  ///< of the joint space; place of the one that carries it
    std::size_t depth = 0, row = 0;
    std::size_t rate = 0;
    AxisView axis{};
    bool single = false;
  };
  std::vector<Dof> dofs_;
  std::vector<std::size_t> carrier_;  ///< by entry of H: the place of its column
  std::vector<Entry> entries_;
  /// Where the kernel's inertia goes to; empty where a tree has a node of several rates, and JointSpace finds
  /// it.
  struct Source {
    std::size_t from = 0, to = 0;
  };
  std::vector<Source> sources_;
  std::vector<double> lanes_;  ///< the kernel's inertia
  bool have_inertia_ = false;
  std::vector<double> H_, A_, L_;  ///< rows of dofs_; A_ with weights and h B, L_ its factor
  std::vector<double> x_, b_, inverse_;
  std::vector<char> locked_;
  std::vector<const double*> q_at_, u_at_;  ///< by Model::dof_count(); null: not a single coordinate
  std::vector<double> q_, u_, given_;
};

}  // namespace handsim::engine::articulated
