// How penetrating surfaces are driven apart, and which bodies were put through each other at the start.
#pragma once

#include <algorithm>
#include <vector>

#include "handsim/engine/collision/collider.h"

namespace handsim::engine {

/// Depth that contacts are allowed to keep, so that resting bodies stay in contact [m].
inline constexpr double kSurfaceLayer = 1e-5;
/// Depth that a pad feels; negative: the gap of a contact to come.
inline double depth_in_pad(const Contact& contact) {
  return contact.depth < 0 ? contact.depth : std::max(contact.depth - kSurfaceLayer, 0.0);
}
/// Fastest at which rigid surfaces found inside each other are driven apart [m/s]. ODE gives that speed to
/// the bodies for good: at 1 m/s a ball of restitution 0 that falls 1 m jumps back at a fifth of its speed.
inline constexpr double kMaxCorrectingSpeed = 0.1;
/// Rigid surfaces are never pressed deeper [m]: such bodies were put through each other.
inline constexpr double kCrossedDepth = 2e-3;
/// Compliance of the contacts of such bodies, against the pair's own inertia. Near 0: contacts that cannot
/// all part at once throw the bodies (fingers crossed by 15 degrees: 72 m/s). Above 1: they part too slowly.
inline constexpr double kCrossedSoftness = 0.1;

class CrossedBodies {
 public:
  /// The model must outlive this object.
  explicit CrossedBodies(const model::Model& model) : model_(model) {}

  /// Finds the crossed bodies among the collider's contacts.
  void find(const Collider& collider);

  /// Where bodies start through each other, contacts push against other contacts or joints: none may be
  /// rigid. Such a contact yields by kCrossedSoftness (1/m_a + 1/m_b) of speed per impulse, like an inverse
  /// mass in series. Its impulse in a step is at most (wanted speed + speed of approach) x reduced mass /
  /// kCrossedSoftness.
  /// @returns this inverse mass for a rigid contact [1/kg]; 0 where neither body is crossed
  double inverse_mass(const Contact& contact) const;

 private:
  int moving_body(int shape) const;

  const model::Model& model_;
  std::vector<int> bodies_;  ///< with repeats
};

}  // namespace handsim::engine
