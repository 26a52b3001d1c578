// The parts of a hand for lists of forces, and the forces on one part.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/model/model.h"

namespace handsim::simulation {

inline constexpr std::array<const char*, 6> kHandParts = {"palm",   "thumb", "index",
                                                          "middle", "ring",  "little"};

/// Index into kHandParts, if it is a part of a hand.
inline std::optional<std::size_t> hand_part(model::Part part) {
  static_assert(static_cast<int>(model::Part::palm) == 0 && static_cast<int>(model::Part::little) == 5);
  return part <= model::Part::little ? std::optional(static_cast<std::size_t>(part)) : std::nullopt;
}

/// The finger that a muscle moves; `wrist` where it moves none.
inline const char* moved_by(const model::Muscle& muscle, const model::Model& model) {
  std::size_t part = 0;
  for (const model::MomentArm& arm : muscle.path.arms)
    for (const model::Joint& joint : model.joints)
      if (joint.first_dof <= arm.dof && arm.dof < joint.first_dof + static_cast<int>(joint.axes.size()))
        for (const model::Shape& shape : model.shapes)
          if (shape.body == joint.child) part = std::max(part, hand_part(shape.part).value_or(0));
  return part == 0 ? "wrist" : kHandParts[part];
}

/// Contact of one part of a hand with the object or hold at one time.
struct PartForce {
  std::string part;  ///< palm, thumb, index, ...
  int contacts = 0;
  double normal = 0;    ///< sum of normal forces [N]
  double friction = 0;  ///< sum of the sizes of friction forces [N]
};

/// The forces on all parts at one time.
struct PartForces {
  std::array<PartForce, kHandParts.size()> each;

  void add(std::size_t part, const engine::Contact& contact) {
    PartForce& sum = each[part];
    sum.part = kHandParts[part];
    ++sum.contacts;
    sum.normal += contact.normal_force();
    sum.friction += contact.friction_force().norm();
  }
  /// The parts of the hand that have contacts.
  std::vector<PartForce> touched() const {
    std::vector<PartForce> out(each.begin(), each.end());
    std::erase_if(out, [](const PartForce& part) { return part.contacts == 0; });
    return out;
  }
};

/// Names its fields to an archive (core/archive.h).
template <class Archive, class T>
void carry_part(Archive& archive, T& part) {
  archive(part.part, part.contacts);
  for (auto* force : {&part.normal, &part.friction}) archive(*force);
}

}  // namespace handsim::simulation
