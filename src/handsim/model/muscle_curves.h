// Force of a Hill-type muscle: curves of Thelen 2003 (J Biomech Eng 125:70, young adults, table 1),
// activation by a first-order law with two time constants (the same, eqs. 1 and 2). Tendons are rigid but
// for at_rest(); elastic_lanes.h has the others.
// Normalised by largest isometric force and optimal fibre length:
//   active length     exp(-(l - 1)^2 / 0.45)
//   passive length    (exp(5 (l - 1) / 0.6) - 1) / (exp(5) - 1), 0 below 1; beyond 1.6 along its tangent
//   speed             eqs. 6 and 7 of the paper, solved for the force, with 0.25 + 0.75 a on the largest
//   speed
// The passive part has a damping of its own, so that a lengthened resting muscle does not swing for ever.
#pragma once

#include "handsim/model/muscle.h"

namespace handsim::model {

/// Constants of the curves, over optimal fibre length and largest isometric force.
namespace hill {
inline constexpr double kActiveWidth = 0.45;   ///< gamma
inline constexpr double kPassiveShape = 5;     ///< k_PE
inline constexpr double kPassiveStrain = 0.6;  ///< epsilon_0
inline constexpr double kSpeedShape = 0.25;    ///< A_f
inline constexpr double kLengthening = 1.4;    ///< largest force of lengthening over the isometric one
inline constexpr double kShortest = 0.2, kLongest = 1.8;  ///< Lengths of fibres with an active force.
inline constexpr double kSteep = (2 + 2 / kSpeedShape) / (kLengthening - 1);  ///< Slope of lengthening.
}  // namespace hill

template <class V>
struct HillConstants;
/// The muscle as the curves of hill_lanes.h take it.
HillConstants<double> hill_constants(const Muscle& muscle);

/// 1 / stretch of an elastic tendon at the largest isometric force [1/m].
double per_stretch(const Muscle& muscle);

/// Fibres at a length of muscle and tendon.
struct Fibre {
  double length = 0;  ///< [m]
  double cosine = 1;  ///< of the pennation
};

/// @param excursion of the path [m]
Fibre fibre_at(const Muscle& muscle, double excursion);

struct Tension {
  double force = 0;      ///< [N], >= 0
  double stiffness = 0;  ///< by the length of muscle and tendon [N/m], may be negative
  double damping =
      0;  ///< by its rate: for an implicit step, at least the slope between the rate and rest [N s/m]
};

/// @param rate of the length of muscle and tendon [m/s], positive: lengthening
Tension tension(const Muscle& muscle, double excursion, double rate, double activation);

/// Tension at rest and full activation less that at none [N]: what the muscle can do at a length.
double isometric_force(const Muscle& muscle, double excursion);
/// Tension at rest without activation [N].
double passive_force(const Muscle& muscle, double excursion);

/// A muscle at rest at an activation, its tendon rigid or elastic.
struct RestingMuscle {
  double fibre_length = 0;  ///< [m]
  double force = 0;         ///< tension [N]
};
RestingMuscle at_rest(const Muscle& muscle, double excursion, double activation);
/// Length of the tendon beside fibres of a length [m].
double tendon_length(const Muscle& muscle, double excursion, double fibre_length);
/// Excursion at which a rigid tendon has fibres of this length [m].
double fibre_excursion(const Muscle& muscle, double fibre_length);

/// Activation after a step [s] that starts at an activation: the law's backward Euler, in 0..1.
double next_activation(const Muscle& muscle, double activation, double excitation, double step);

}  // namespace handsim::model
