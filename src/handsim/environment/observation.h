// Observation of an environment: a flat vector of parts that the caller selects by name, in their order.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "handsim/engine/collision/taxels.h"
#include "handsim/simulation/simulation.h"

namespace handsim::environment {

/// A part and the names of its numbers, e.g. `right.index_mcp.flexion.rate[rad/s]`.
struct ObservedPart {
  std::string name;
  std::size_t first = 0;  ///< in the vector
  std::vector<std::string> columns;
};

/// The parts that a name selects:
///   time              [s]
///   q, u, tau         coordinates, rates, and torques that acted in the last step, as State has them
///   wrists            of each hand, hand frame H: p [m], quaternion w x y z, v [m/s], w [rad/s]; world axes
///   fingertips        of each finger, hand after hand: p [m] and quaternion w x y z of the last segment
///   objects           of each object that can move: p [m], quaternion, v [m/s], w [rad/s] of its body
///                     (centre of mass), world axes
///   finger_contacts   of palm and fingers of each hand: force on it [N], world axes, and number of points
///   taxels            normal force [N] on points of the finger pads, 5 mm apart (engine/collision/taxels.h)
///   contact_pairs     of palm and fingers with each object, then with all else: normal force [N], points
///   excitation, activation            of each muscle, 0 to 1
///   fibre_length, fibre_speed         of each muscle [m], lengthening [m/s]
///   tendon_length, tendon_force       of each muscle [m], [N]; speed and force at the end of the last step
///   failed            1 where a criterion of the scene is not held up to now, else 0; needs watchers
class Observation {
 public:
  /// The scene must outlive this object. @throws Error (input) for unknown names.
  Observation(const scene::Scene& scene, std::span<const std::string> names);

  std::size_t size() const { return size_; }
  std::span<const ObservedPart> parts() const { return parts_; }
  /// @returns whether the observation needs watchers, which measure what the criteria judge
  bool needs_watchers() const { return has("failed"); }
  /// @returns whether the observation needs the contact forces of the engine (settings.contact_forces).
  bool needs_forces() const { return has("finger_contacts") || has("contact_pairs") || has("taxels"); }
  /// @param out of size().
  void write(const simulation::Simulation& simulation, std::span<double> out) const;

 private:
  /// A kind of part: its name, the names of its numbers, and how they are written.
  struct Kind;
  static std::span<const Kind> kinds();
  void collect_things();
  bool has(std::string_view part) const;
  void write_contacts(std::span<const engine::Contact> contacts, std::span<double> by_finger,
                      std::span<double> by_pair) const;

  const scene::Scene& scene_;
  std::vector<ObservedPart> parts_;
  std::vector<const Kind*> kinds_;  ///< of the parts
  std::size_t size_ = 0;
  std::vector<const model::Fingertip*> tips_;
  std::vector<int> objects_;             ///< bodies
  std::vector<std::string> hand_parts_;  ///< palm and fingers of each hand
  std::vector<std::string> others_;      ///< objects, then `other`
  /// For each shape the index in hand_parts_ if it is part of a hand; else other_ has its index in others_.
  std::vector<std::optional<std::size_t>> hand_part_;
  std::vector<std::size_t> other_;
  std::optional<engine::Taxels> taxels_;  ///< where they are observed
};

}  // namespace handsim::environment
