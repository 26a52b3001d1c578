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

/// The bodies of a tree as one: world axes, about the island's origin; where Mechanism last found them.
class TreeBodies {
 public:
  void add(const Mechanism& mechanism, int node);
  /// Takes over the bodies' masses.
  void refresh();
  double mass() const { return mass_; }  ///< [kg]
  Vec3 moment() const;                   ///< mass times mass centre [kg m]
  Mat3 inertia() const;                  ///< rotational [kg m^2]
  /// Angular, then linear; and [J]: both after Kernel::momenta.
  Spatial momentum() const;
  double kinetic() const;
  /// The spatial velocity of one rigid body, with moment and inertia as given, that has a momentum.
  Spatial rigid_velocity(const Vec3& moment, const Mat3& inertia, const Spatial& momentum) const;

 private:
  template <std::size_t N>
  std::array<double, N> sum(const double* NodeView::*of) const;

  std::vector<const NodeView*> views_;
  std::size_t stride_ = 1;
  double mass_ = 0;
};

class MomentumBalance {
 public:
  /// @param mechanism must outlive this.
  explicit MomentumBalance(Mechanism& mechanism);

  /// True for trees with joints, which take part in every step.
  bool jointed() const { return jointed_; }
  void refresh();
  /// Whether the step that `begin` was called for corrects a tree.
  bool active() const { return active_; }
  /// Finds the momentum at the end of a step [s]; before it moves anything. @param contacts solved, or null
  /// @param smooth mass centres fall along the parabola; all objects take part
  void begin(std::span<const BodyForce> forces, const ContactDynamics* contacts, double step, bool smooth);
  /// Gives the trees their momentum at the end of the step; `kinematics` has to be found, and is again.
  /// @param sound what it returned. @returns false where a speed leaves its bounds
  bool correct(bool sound);

 private:
  struct Tree {
    TreeBodies bodies;
    int root = 0, island = 0;
    bool jointed = false, active = false;
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();  ///< [kg m/s], about the mass centre [kg m^2/s]
    Vec3 centre = Vec3::Zero();  ///< of mass at the start, later at the end: world [m]
  };
  /// In trees_: stands for all that bases hold, and never takes part.
  static constexpr std::size_t kHeld = 0;
  std::size_t tree_of(int node) const { return node == kNoNode ? kHeld : tree_of_[at(node)]; }
  void choose(const ContactDynamics* contacts, bool smooth);
  std::size_t group(std::size_t tree);
  void add(int node, const Vec3& point, const Vec3& impulse, const Vec3& moment);

  Mechanism& mechanism_;
  std::vector<Tree> trees_;
  std::vector<std::size_t> tree_of_;  ///< of each node
  std::vector<std::size_t> group_;    ///< of each tree: another of those that contacts connect, or itself
  bool jointed_ = false, active_ = false;
};

}  // namespace handsim::engine::articulated
