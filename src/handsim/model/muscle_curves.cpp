#include "handsim/model/muscle_curves.h"

#include <cmath>

#include "handsim/model/elastic_lanes.h"

namespace handsim::model {

namespace {

constexpr double kPassiveDamping = 0.1;  ///< of the passive part's force and speed: chosen

/// Sine of an angle up to 1.4 rad, to 1.2e-10: a call of std::sin takes longer than the rest of a fibre.
double sine(double x) {
  const double s = x * x;
  return x *
         (1 - s * (1.0 / 6) *
                  (1 - s * (1.0 / 20) *
                           (1 - s * (1.0 / 42) *
                                    (1 - s * (1.0 / 72) * (1 - s * (1.0 / 110) * (1 - s * (1.0 / 156)))))));
}

}  // namespace

HillConstants<double> hill_constants(const Muscle& muscle) {
  const double across = muscle.pennation == 0 ? 0 : muscle.fibre_length * sine(muscle.pennation);
  return {muscle.force,
          muscle.fibre_length,
          1 / muscle.fibre_length,
          across * across,
          muscle.length - muscle.slack_length,
          1e-3 * muscle.fibre_length,
          muscle.max_speed,
          kPassiveDamping / muscle.max_speed};
}

double per_stretch(const Muscle& muscle) { return 1 / (*muscle.tendon_strain * muscle.slack_length); }

Fibre fibre_at(const Muscle& muscle, double excursion) {
  const HillFibre<double> fibre = hill_fibre(hill_constants(muscle), excursion);
  return {fibre.length, fibre.cosine};
}

Tension tension(const Muscle& muscle, double excursion, double rate, double activation) {
  const HillTension<double> found = hill_tension(hill_constants(muscle), excursion, rate, activation);
  return {found.force, found.stiffness, found.damping};
}

double isometric_force(const Muscle& muscle, double excursion) {
  const Fibre fibre = fibre_at(muscle, excursion);
  return muscle.excitable * muscle.force * fibre.cosine *
         hill_active(fibre.length / muscle.fibre_length).value;
}

double passive_force(const Muscle& muscle, double excursion) {
  const Fibre fibre = fibre_at(muscle, excursion);
  return muscle.force * fibre.cosine * hill_passive(fibre.length / muscle.fibre_length).value;
}

RestingMuscle at_rest(const Muscle& muscle, double excursion, double activation) {
  if (!muscle.tendon_strain)
    return {fibre_at(muscle, excursion).length, tension(muscle, excursion, 0, activation).force};
  const HillConstants<double> hill = hill_constants(muscle);
  const double taut = hill.reach - excursion;
  const ElasticPull<double> found =
      elastic_pull(hill, ElasticStep<double>{per_stretch(muscle), taut, taut, 0, 0, activation});
  return {std::sqrt(hill.height + found.reach * found.reach), found.force};
}

double tendon_length(const Muscle& muscle, double excursion, double fibre_length) {
  return muscle.length - excursion - fibre_reach(hill_constants(muscle), fibre_length);
}

double fibre_excursion(const Muscle& muscle, double fibre_length) {
  const HillConstants<double> hill = hill_constants(muscle);
  return hill.reach - fibre_reach(hill, fibre_length);
}

double next_activation(const Muscle& muscle, double activation, double excitation, double step) {
  return hill_activation(muscle.activation_time, muscle.deactivation_time, activation, excitation, step);
}

}  // namespace handsim::model
