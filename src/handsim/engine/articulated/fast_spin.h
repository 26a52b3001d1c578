// Bounds on the energy of trees that turn fast. A step that takes velocity products at its start
// gains kinetic energy in proportion to the square of the angle by which bodies turn in it; a hand that spins
// freely blows up. Trees beyond a bound of this angle are therefore watched: the work of all forces on them,
//   W = h f . (u0 + u1) / 2,
// f the generalised forces that the step found (joints, stops, contacts, loops), and gravity's potential say
// what kinetic energy they may have. As soon as the angles of the steps since the last comparison add up to
// what could be an error, the two are compared; energy beyond the bound and a tolerance is taken from the
// motion of the joints against each other: at rates u, with u_1 those as one rigid body, u_1 + s (u - u_1)
// has the same momentum and the energy T_1 + s^2 (T - T_1). Where that is too little, a tree on a base loses
// rotation as a whole; a free tree keeps its momentum (momentum.h).
// Positions stay those of the step: stops and contacts that it landed on are met. A tree on a moving base,
// whose work is not known, is left alone, and so are all trees in a step with forces from outside.
#pragma once

#include <vector>

#include "handsim/engine/articulated/momentum.h"

namespace handsim::engine::articulated {

/// Turns per step at which a tree is watched [rad]: nothing drives it; a servo or torque does (its work hides
/// a gain of 1 %); muscles do (their forces change more in a step). At 1 ms 2, 20 and 100 rad/s.
inline constexpr double kPassiveTurn = 0.002, kDrivenTurn = 0.02, kPulledTurn = 0.1;
/// Watches the trees that turn fast, and takes energy from them that they could not gain.
class FastSpin {
 public:
  /// The model and the mechanism must outlive this object. @param muscles whether their effect is listed
  FastSpin(const model::Model& model, Mechanism& mechanism, bool muscles);

  /// Reads masses again after they changed in the mechanism; no tree is watched any more.
  void refresh();
  /// No tree is watched any more.
  void forget();
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);
  /// Finds the trees that turn fast; called before the bases get the step's velocities. @param step [s]
  /// @returns whether there is one
  bool begin_step(const StepInput& input, double step);
  /// Adds the work of all forces in a step, by the accelerations that it found, Mechanism::du(); called
  /// before anything moves. @param constrained loops or contacts act beside the forces of the joints
  void add_work(bool constrained);
  /// Corrects the rates of fast trees at the end of a step, where a comparison of energies is due.
  /// `kinematics` has been called, and is called again. @param sound what `kinematics` returned. @returns
  /// false where a speed leaves its bounds
  bool correct(bool sound);

 private:
  struct SpinningTree {
    std::vector<int> nodes;  ///< the root first
    TreeBodies bodies;
    std::vector<int> balls;              ///< nodes
    std::vector<const double*> spins;    ///< NodeView::spin
    std::vector<const double*> works;    ///< NodeView::work
    std::vector<int> dofs;               ///< of the joint space
    std::vector<std::size_t> driven_by;  ///< dofs of the model, of joints that torques or servos may drive
    const double* stop = nullptr;        ///< of a root of one rate: NodeView::side
    int island = 0, base = model::kWorld;
    bool free = false;
    bool pulled = false;  ///< by muscles
    bool looped = false;  ///< by a joint that is held by constraints
    bool fast = false;
    // Since it is fast.
    bool watched = false;
    double turned = 0;  ///< squares of the turns since the last comparison [rad^2]
    double energy = 0;  ///< that it may have: kinetic and gravity's [J]
    double credit = 0;  ///< that its inertia lost, less what was lent of it [J]
  };
  /// The turn of a step above which a tree counts as fast [rad].
  double turn_threshold(const SpinningTree& tree, const StepInput& input) const;
  double turn(const SpinningTree& tree) const;
  double potential(const SpinningTree& tree) const;
  Spatial as_one_body(const SpinningTree& tree, const Spatial& momentum) const;
  bool project(SpinningTree& tree);
  void reduce_energy(SpinningTree& tree, double kinetic, double allowed);

  Mechanism& mechanism_;
  JointSpace space_;
  std::vector<SpinningTree> trees_;
  double step_ = 0;
  std::vector<double> accelerations_, forces_;  ///< of each dof
};

}  // namespace handsim::engine::articulated
