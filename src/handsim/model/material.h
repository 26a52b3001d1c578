// The surface of a shape. A new property of surfaces is a member and its line in Material::fields: reading,
// checks, how two surfaces combine and what acts on nothing follow from it; each engine's law is then to be
// written.
#pragma once

#include <optional>
#include <string>

#include "handsim/core/fields.h"
#include "handsim/core/units.h"
#include "handsim/model/effects.h"

namespace handsim::model {

/// Compliant contact of two surfaces: normal force = stiffness depth + damping d(depth)/dt, never negative.
/// The values hold for a whole pair of shapes; its contact points share them.
struct Compliance {
  double stiffness = 0;  ///< [N/m], > 0
  double damping = 0;    ///< [N s/m], >= 0
};

/// The value of a contact from those of its two surfaces. In series: as two springs or two dampers; where one
/// is absent or 0, the other's.
enum class OfTwo { geometric_mean, larger, in_series };

struct Material {
  std::string name;
  double friction = 0.8;                 ///< Coulomb coefficient
  double restitution = 0;                ///< speed after an impact over the speed before it
  double restitution_speed = 0.05;       ///< impacts slower than this do not bounce [m/s]
  std::optional<Compliance> compliance;  ///< absent: rigid
  double rolling_friction = 0;           ///< largest rolling moment per normal force [m]
  double spinning_friction = 0;          ///< largest moment about the normal per normal force [m]

  /// Each key with its range, its value in a contact of two surfaces, and the effect without which it acts on
  /// nothing, if that is not contact itself (core/fields.h). docs/scenes.md says what the keys mean.
  template <class Visit>
  static void fields(Visit&& visit) {
    constexpr Effect kFriction = Effect::friction;
    visit("friction", &Material::friction, Quantity{Dimension::none, 0, 10}, OfTwo::geometric_mean,
          kFriction);
    visit("restitution", &Material::restitution, Quantity{Dimension::none, 0, 1}, OfTwo::larger);
    visit("restitution_speed", &Material::restitution_speed, Quantity{Dimension::speed, 0, 100},
          OfTwo::larger);
    visit("rolling_friction", &Material::rolling_friction, Quantity{Dimension::length, 0, 1}, OfTwo::larger,
          kFriction);
    visit("spinning_friction", &Material::spinning_friction, Quantity{Dimension::length, 0, 1}, OfTwo::larger,
          kFriction);
    visit("stiffness", in_part(&Material::compliance, &Compliance::stiffness),
          Quantity{Dimension::stiffness, 1, 1e9}, OfTwo::in_series);
    visit("damping", in_part(&Material::compliance, &Compliance::damping),
          Quantity{Dimension::damping, 0, 1e6}, OfTwo::in_series);
  }
};

/// The surface of a contact of two surfaces; it has no name.
Material combined(const Material& a, const Material& b);

}  // namespace handsim::model
