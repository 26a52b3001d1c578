#include "handsim/model/muscle_curves.h"

#include <algorithm>
#include <cmath>

namespace handsim::model {

namespace {

using namespace hill;

constexpr double kExpShape = 147.4131591025766;  ///< exp(k_PE) - 1
constexpr double kPassiveDamping = 0.1;          ///< of the passive part's force and speed: chosen

/// Of angles up to 1.4 rad, to 1e-11: a call of std::sin takes longer than the rest of a fibre.
double sine(double x) {
  const double s = x * x;
  return x *
         (1 - s * (1.0 / 6) *
                  (1 - s * (1.0 / 20) *
                           (1 - s * (1.0 / 42) *
                                    (1 - s * (1.0 / 72) * (1 - s * (1.0 / 110) * (1 - s * (1.0 / 156)))))));
}

/// A factor of the force and its derivative.
struct Curve {
  double value = 0, slope = 0;
};

Curve active_length(double l) {
  if (l < kShortest || l > kLongest) return {};
  const double x = l - 1, value = std::exp(-x * x / kActiveWidth);
  return {value, -2 * x / kActiveWidth * value};
}

Curve passive_length(double l) {
  if (l <= 1) return {};
  const double strain = std::min(l - 1, kPassiveStrain) / kPassiveStrain;
  const double grown = std::exp(kPassiveShape * strain);
  const double slope = kPassiveShape / kPassiveStrain * grown / kExpShape;
  return {(grown - 1) / kExpShape + slope * std::max(0.0, l - 1 - kPassiveStrain), slope};
}

/// Factor of the speed. @param w rate over the largest speed at the activation, positive: lengthening. The
/// slope is the greater of the tangent's and the chord's to rest: a step that is linear by it does not
/// overshoot.
Curve speed(double w) {
  if (w <= -1) return {0, -1 / w};
  const double value =
      w < 0 ? (1 + w) / (1 - w / kSpeedShape) : (1 + kSteep * kLengthening * w) / (1 + kSteep * w);
  const double tangent = w < 0 ? (1 + 1 / kSpeedShape) / ((1 - w / kSpeedShape) * (1 - w / kSpeedShape))
                               : kSteep * (kLengthening - 1) / ((1 + kSteep * w) * (1 + kSteep * w));
  const double chord = w == 0 ? tangent : (value - 1) / w;
  return {value, std::max(tangent, chord)};
}

}  // namespace

Fibre fibre_at(const Muscle& muscle, double excursion) {
  const double height = muscle.pennation == 0 ? 0 : muscle.fibre_length * sine(muscle.pennation);
  const double along = std::max(muscle.length - excursion - muscle.slack_length, 1e-3 * muscle.fibre_length);
  const double length = std::sqrt(height * height + along * along);
  return {length, along / length};
}

Tension tension(const Muscle& muscle, double excursion, double rate, double activation) {
  const Fibre fibre = fibre_at(muscle, excursion);
  const double l = fibre.length / muscle.fibre_length, per = fibre.cosine / muscle.fibre_length;
  const double top = (0.25 + 0.75 * activation) * muscle.max_speed;
  const Curve fp = passive_length(l);
  // A resting muscle has the passive part alone.
  const Curve fl = activation > 0 ? active_length(l) : Curve{};
  const Curve fv = activation > 0 ? speed(rate * per / top) : Curve{};
  const double strength = muscle.force * fibre.cosine;
  const double drag = kPassiveDamping * fp.value / muscle.max_speed;
  const double force = activation * fl.value * fv.value + fp.value + drag * rate * per;
  if (force <= 0) return {};
  return {strength * force, strength * (activation * fl.slope * fv.value + fp.slope) * per,
          strength * (activation * fl.value * fv.slope / top + drag) * per};
}

double isometric_force(const Muscle& muscle, double excursion) {
  const Fibre fibre = fibre_at(muscle, excursion);
  return muscle.force * fibre.cosine * active_length(fibre.length / muscle.fibre_length).value;
}

double passive_force(const Muscle& muscle, double excursion) {
  const Fibre fibre = fibre_at(muscle, excursion);
  return muscle.force * fibre.cosine * passive_length(fibre.length / muscle.fibre_length).value;
}

double next_activation(const Muscle& muscle, double activation, double excitation, double step) {
  const double slowed = 0.5 + 1.5 * activation;
  const double time =
      excitation > activation ? muscle.activation_time * slowed : muscle.deactivation_time / slowed;
  const double share = step / time;
  return std::clamp((activation + share * excitation) / (1 + share), 0.0, 1.0);
}

}  // namespace handsim::model
