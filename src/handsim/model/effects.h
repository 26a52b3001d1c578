// The physical effects that a scene can switch on. Engines neither build nor evaluate the others.
#pragma once

#include <array>
#include <string_view>

namespace handsim::model {

enum class Effect {
  gravity,
  object_contact,
  self_contact,
  ground_contact,
  friction,
  joint_stops,
  passive_tissue,
  actuation,
  wrist_motion,
  muscles,
  tendon_coupling,
};

inline constexpr std::array<std::string_view, 11> kEffectNames = {
    "gravity",        "object_contact", "self_contact", "ground_contact", "friction",       "joint_stops",
    "passive_tissue", "actuation",      "wrist_motion", "muscles",        "tendon_coupling"};
inline constexpr int kEffectCount = static_cast<int>(kEffectNames.size());

inline std::string_view name(Effect effect) { return kEffectNames[static_cast<std::size_t>(effect)]; }

/// A set of effects.
class Effects {
 public:
  bool has(Effect effect) const { return (bits_ & bit(effect)) != 0; }
  void add(Effect effect) { bits_ |= bit(effect); }
  void remove(Effect effect) { bits_ &= ~bit(effect); }
  bool any_contact() const {
    return has(Effect::object_contact) || has(Effect::self_contact) || has(Effect::ground_contact);
  }
  bool operator==(const Effects&) const = default;

 private:
  static unsigned bit(Effect effect) { return 1U << static_cast<unsigned>(effect); }
  unsigned bits_ = 0;
};

}  // namespace handsim::model
