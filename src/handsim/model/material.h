// The surface of a shape. A new property of surfaces is a member and its line in Material::fields: reading,
// checks, how two surfaces combine and what acts on nothing follow from it; each engine's law is then to be
// written.
#pragma once

#include <optional>
#include <string>

#include "handsim/core/fields.h"
#include "handsim/core/units.h"
#include "handsim/model/compliance.h"
#include "handsim/model/effects.h"

namespace handsim::model {

/// Friction that depends on the normal force F of a pair: the coefficient times at_one F^exponent, within
/// `least` and `most`; F in N.
struct FrictionOverLoad {
  double exponent = 0, at_one = 1, least = 1, most = 1;
  double factor(double force) const;
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
  /// Instead: that of the disc that is pressed flat, 8/15 friction times its radius. Needs compliance.
  bool spins_by_area = false;
  std::optional<FrictionOverLoad> friction_over_load;  ///< needs a law of compliance

  /// Largest moment about the normal per normal force of a contact at a depth, with its friction [m].
  double spinning(double friction_there, double depth) const;

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

/// The surface of a contact of two surfaces; it has no name. Laws of compliance act in series, and friction
/// over load is the geometric mean.
Material combined(const Material& a, const Material& b);

}  // namespace handsim::model
