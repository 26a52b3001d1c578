// Momentum of trees that no base holds: free hands and objects. The rates that a step finds obey Newton's law
// where the step starts; where it ends, the tree has turned and bent, and the same rates have another
// momentum. So at its end each such tree is given, as one rigid body, the momentum that is missing to
//   P1 = P0 + h (m g + sum f) + sum j,   L1 = L0 + sum ((x - c0) x (h f + j) + moments),
// L about the mass centre c0 at the start, j the contacts' impulses at points x, equal and opposite on both
// bodies. The mass centre is brought to c0 + (h / m) P1, so that the momentum about any fixed point follows
// Newton's law, too. Rates of joints stay those of the step.
//
// An object without joints has that momentum in free flight (spin.h). It is corrected where it touches only
// what floats, too: what a base holds takes momentum out of any sum.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "handsim/engine/articulated/dynamics/joint_space.h"

namespace handsim::engine::articulated {

class ContactDynamics;

/// Mass, inertia and motion of all bodies of a tree together, in world axes about the island's origin, where
/// the mechanism's `kinematics` last found them.
class TreeBodies {
 public:
  void add(const Mechanism& mechanism, int node);
  /// Reads the bodies' masses again after they changed in the mechanism.
  void refresh();
  double mass() const { return mass_; }  ///< [kg]
  Vec3 moment() const;                   ///< mass times mass centre [kg m]
  Mat3 inertia() const;                  ///< rotational [kg m^2]
  /// Angular, then linear momentum, as Kernel::momenta last found it.
  Spatial momentum() const;
  /// Kinetic energy [J], as Kernel::momenta last found it.
  double kinetic() const;
  /// The spatial velocity at which one rigid body of this moment and inertia has this momentum.
  Spatial rigid_velocity(const Vec3& moment, const Mat3& inertia, const Spatial& momentum) const;

 private:
  template <std::size_t N>
  std::array<double, N> sum(const double* NodeView::*of) const;

  std::vector<const NodeView*> views_;
  std::size_t stride_ = 1;
  double mass_ = 0;
};

/// Keeps the momentum of free trees over a step.
class MomentumBalance {
 public:
  /// @param mechanism must outlive this object.
  explicit MomentumBalance(Mechanism& mechanism);

  /// @returns whether a free tree has joints; such trees are corrected in every step
  bool jointed() const { return jointed_; }
  void refresh();
  /// @returns whether `begin_step` found a tree to correct at the end of its step
  bool active() const { return active_; }
  /// Computes the momentum that each tree has to have at the end of a step; called before anything moves.
  /// @param contacts that the step has solved, or null @param step its length [s]
  /// @param smooth a method for smooth motion: mass centres fall along the parabola, all objects are
  /// corrected
  void begin_step(std::span<const BodyForce> forces, const ContactDynamics* contacts, double step,
                  bool smooth);
  /// Gives the trees that momentum at the end of the step, where `kinematics` was called, and calls it again.
  /// @param sound what `kinematics` returned. @returns false where a speed leaves its bounds
  bool correct(bool sound);

 private:
  struct FreeTree {
    TreeBodies bodies;
    int root = 0, island = 0;
    bool jointed = false, active = false;
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();  ///< [kg m/s], about the mass centre [kg m^2/s]
    Vec3 centre = Vec3::Zero();  ///< of mass at the start, later at the end: world [m]
  };
  /// In trees_: stands for all that bases hold, and never takes part.
  static constexpr std::size_t kHeld = 0;
  std::size_t tree_of(int node) const { return node == kNoNode ? kHeld : tree_of_[as_index(node)]; }
  void choose(const ContactDynamics* contacts, bool smooth);
  std::size_t group(std::size_t tree);
  void add(int node, const Vec3& point, const Vec3& impulse, const Vec3& moment);

  Mechanism& mechanism_;
  std::vector<FreeTree> trees_;
  std::vector<std::size_t> tree_of_;  ///< of each node
  std::vector<std::size_t> group_;    ///< of each tree: another of those that contacts connect, or itself
  bool jointed_ = false, active_ = false;
};

}  // namespace handsim::engine::articulated
