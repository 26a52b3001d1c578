// Steps of trees that turn fast. The rates of a step that takes velocity products at its start gain energy in
// proportion to the square of the angle that bodies turn in a step; a hand that spins freely blows up. For
// trees beyond a bound this angle has, the rates that such a step ends with are corrected, so that
//   (S_j(q0) + S_j(q1)) / 2 . (L_j(q1, u1) - L_j(q0, u0)) = h f_j                                      (1)
// for every dof j: S_j its axis, L_j the momentum about a fixed point of all that it carries, f_j the
// generalised force that the step found (joints, stops, contacts, loops, gravity). What is left of (1) at the
// step's own rates is an impulse; the inertia at the end of the step turns it into changes of the rates.
// A free tree keeps its linear and angular momentum to rounding, as S is constant for its root. The mean of
// both axes makes the work of centripetal forces vanish in the first order, which those at either end do not:
// with the start's, bodies on a circle gain (h w)^2 of their energy a step; with the end's, they lose as
// much.
//
// What (1) leaves of energy gained, T(q1, u1) - T(q0, u0) - h f . (u0 + u1) / 2 > 0, is taken from the motion
// of the joints against each other; the momentum that the tree's root sees stays. Where that is too little,
// it may use what inertia lost in the steps before; the rest is taken from the rotation of the whole, and
// only then angular momentum is lost. So a passive tree's kinetic energy never rises by its inertia's doing;
// that of a tree on a moving base is not looked after. Positions stay those of the step: stops and contacts
// that it landed on are met.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "handsim/engine/articulated/joint_space.h"

namespace handsim::engine::articulated {

/// Turns per step from which on rates are corrected [rad]: of a tree that nothing drives, and of one with a
/// servo, a torque or a moving base, whose work hides a gain of 1 %. At 1 ms these are 2 and 20 rad/s.
inline constexpr double kPassiveTurn = 0.002, kDrivenTurn = 0.02;

class FastSpin {
 public:
  /// Both must outlive this.
  FastSpin(const model::Model& model, Mechanism& mechanism);

  /// Forgets what steps before have lost.
  void forget();
  void save(ArchiveWriter& out) const;
  void restore(ArchiveReader& in);
  /// Finds the fast trees and keeps what their step starts from; before bases get the step's velocities.
  /// @param step [s] @returns false where none is fast: the step needs nothing of what follows
  bool begin(const StepInput& input, double step);
  /// Keeps the impulses of the accelerations found, Mechanism::du(); before these move anything.
  void keep_impulses();
  /// Places free trees after the step moved them: their centre of mass moves on in a straight line, and not
  /// the root's, which the rates have, around which the rest would gain and lose energy as it turns.
  void place();
  /// Corrects the rates of fast trees at the end of the step; `kinematics` has to be found, and is again.
  /// @returns false where a speed leaves its bounds
  bool correct();

 private:
  struct Tree {
    std::vector<int> nodes;              ///< the root first
    std::vector<int> dofs;               ///< of the joint space
    std::vector<std::size_t> driven_by;  ///< dofs of the model, of joints that torques or servos may drive
    const double* stop = nullptr;        ///< of a root of one rate: AxisView::side
    int island = 0, base = model::kWorld;
    bool fast = false;
    bool carried = false;        ///< by a base that moves
    Vec3 origin = Vec3::Zero();  ///< at the start
    double credit = 0;  ///< energy that inertia lost in corrected steps, less what was lent of it [J]
    double energy = 0;  ///< kinetic, at the start [J]
    double mass = 0;    ///< [kg]
    Vec3 momentum = Vec3::Zero();  ///< linear, at the start [kg m/s]
    Vec3 centre = Vec3::Zero();    ///< of mass, from the origin, at the start [m]
  };
  bool driven(const Tree& tree, const StepInput& input) const;
  void keep_start(Tree& tree);
  Spatial momentum(int node) const;
  void find_residuals(const Tree& tree);
  std::pair<Spatial, double> motion(const Tree& tree) const;
  std::pair<Spatial, double> as_one_body(const Tree& tree, const Spatial& momentum) const;
  bool keep_energy(Tree& tree);

  Mechanism& mechanism_;
  JointSpace space_;
  std::vector<NodeView> views_;
  std::vector<Tree> trees_;
  double step_ = 0;
  std::vector<Spatial> start_, end_;      ///< momenta of each node and all that it carries
  std::vector<Spatial> axes_;             ///< of each dof at the start
  std::vector<double> rates_, impulses_;  ///< of each dof: at the start, of the step
  std::vector<double> accelerations_, residuals_;
};

}  // namespace handsim::engine::articulated
