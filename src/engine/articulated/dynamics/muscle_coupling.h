// Muscles and bands in the step of a mechanism. Their torques at the step's end couple the coordinates
// that a tendon crosses (engine/muscles.h): H becomes H + h B. All coordinates of a tendon lie on one branch,
// so that the factor of H + h B has the same zeros as that of H. The kernels' own solution knows of no B: it
// is corrected by one factorisation of the trees that have tendons (kernels/kernel_coupling.h).
#pragma once

#include <span>
#include <vector>

#include "handsim/engine/articulated/dynamics/joint_space.h"
#include "handsim/engine/muscles.h"

namespace handsim::engine::articulated {

/// TendonRows with all that they point to.
class TendonMemory {
 public:
  /// @param dofs without pointers yet. @param from places among `inertia` numbers of H. @param width of lanes
  void make(std::vector<CoupledDof> dofs, std::vector<CoupledEntry> entries, std::vector<int> carrier,
            std::vector<int> from, std::size_t inertia, std::size_t width);
  const TendonRows& rows() const { return rows_; }
  std::vector<CoupledDof> dofs;  ///< pointers to be set

 private:
  struct alignas(64) Line {
    double x[8];
  };
  TendonRows rows_;
  std::vector<CoupledEntry> entries_;
  std::vector<int> carrier_, from_;
  std::vector<Line> memory_;
};

class MuscleCoupling {
 public:
  /// All must outlive this.
  MuscleCoupling(const model::Model& model, const Settings& settings, Mechanism& mechanism);

  bool empty() const { return muscles_.empty(); }
  void start(const model::State& state) { muscles_.start(state); }
  /// Tensions of the step from where `kinematics` last found the mechanism.
  /// @return the step's plain torques and those of the tendons at its start, by Model::dof_count()
  std::span<const double> begin(const StepInput& input);
  /// As above, but from coordinates and rates, each of size Model::dof_count().
  std::span<const double> begin(std::span<const double> q, std::span<const double> u, const StepInput& input);
  std::span<const double> given() const { return given_; }  ///< what `begin` returned
  void keep() {}  ///< For LaneGroup; `begin` keeps what `go_back` needs.
  /// Takes the last `begin` back, once: its step was not made.
  void go_back() { muscles_.go_back(); }
  /// Changes the accelerations that the kernel found, and the reactions of its locks, to those with h B.
  void correct(double step);
  /// Adds h B to an inertia of the same mechanism.
  template <class Of>
  void add_to(JointSpace& space, double step, const Of& of) const {
    for (std::size_t k = 0; k < entries_.size(); ++k) {
      const auto [i, j] = space_dofs_[k];
      if (of(i)) space.add(i, j, step * slopes()[k]);
    }
  }
  /// Calls f(i, j, entry of B) with dofs of the joint space, j carries i or is i.
  template <class F>
  void each_slope(const F& f) const {
    for (std::size_t k = 0; k < entries_.size(); ++k)
      f(space_dofs_[k].first, space_dofs_[k].second, slopes()[k]);
  }
  /// Whether a tendon crosses a coordinate of the model.
  bool pulls(std::size_t dof) const;
  /// Removes h B du from the torques that `compute_torques` wrote.
  void compute_torques(double step) { scalar_.compute_torques(memory_.rows(), step); }
  /// Writes activations, fibre lengths and tensions.
  void give(model::State& state) const { muscles_.end(state.q, state.u, state); }

  /// True where trees with tendons have nodes of one rate only.
  bool single() const { return single_; }
  /// Makes `memory` for lanes. @param inertia count of Kernel::inertia's numbers. @param first index by node
  void make(TendonMemory& memory, std::size_t inertia, const std::vector<std::size_t>& first,
            std::size_t width) const;
  int node(std::size_t dof) const { return nodes_[dof]; }
  /// Entries of B, as `begin` found them.
  std::span<const double> slopes() const { return {memory_.rows().slope, entries_.size()}; }

 private:
  void collect_trees();
  void collect_entries();
  void collect_sources();
  bool on_one_branch(int a, int b) const;
  void compute_inertia();

  Mechanism& mechanism_;
  const LaneKernel& scalar_;
  JointSpace space_;
  std::vector<int> space_dof_;  ///< of the joint space, of each coordinate of the model, or kNoDof
  Muscles muscles_;
  std::vector<char> with_tendons_;  ///< by dof of the joint space: its tree has some
  // By coordinate of a tree with tendons.
  std::vector<CoupledDof> rows_;
  std::vector<int> dofs_, nodes_;
  std::vector<int> carrier_;
  // By entry of B: slope of muscles_, and dofs of the joint space.
  std::vector<CoupledEntry> entries_;
  std::vector<std::size_t> slopes_;
  std::vector<std::pair<int, int>> space_dofs_;
  TendonMemory memory_;
  double unused_ = 0;  ///< force and reaction of coordinates of nodes of several rates
  bool single_ = true;
  bool have_inertia_ = false;
  std::vector<const double*> q_at_, u_at_;  ///< by Model::dof_count(); null: not a single coordinate
  std::vector<double> q_, u_, given_;
};

}  // namespace handsim::engine::articulated
