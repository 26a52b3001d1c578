// Forces on the flexor pulleys of a finger from its tendons' tensions and its PIP angle. A2 and A4 stand on
// both sides of the PIP; the tendons turn there by the angle of the joint, half of it at each pulley. A
// tendon of tension T that turns by an angle t presses with 2 T sin(t / 2); so a pulley carries 2 T sin(PIP /
// 4). The superficial flexor ends between the two and loads A2 alone. With the tensions and pulley forces at
// failure of Schoeffl 2009 (J Biomech 42:2183), 348 N and 287 N in a crimp, 371 N and 121 N in a slope grip,
// at PIP angles of 87 and 39 deg (Fischer 2024, Bioengineering 11:370), this gives 258 and 125 N.
// Bowstringing is left out, and friction in the sheath but for sheath_gain().
#pragma once

#include <algorithm>
#include <cmath>

namespace handsim::model {

/// Largest force on A2 [N]: of 12 cadaver fingers loaded in a crimp until something tore, 287 N (Schoeffl
/// 2009).
inline constexpr double kPulleyStrength = 287;

/// Tensions of a finger's flexors [N].
struct FlexorTensions {
  double deep = 0, superficial = 0;
};

/// Tensions for the moments of DIP and PIP [N m] without antagonists; the deep flexor alone crosses the DIP.
/// @param deep_dip, deep_pip, superficial_pip moment arms [m], > 0
inline FlexorTensions flexor_tensions(double dip, double pip, double deep_dip, double deep_pip,
                                      double superficial_pip) {
  const double deep = std::max(0.0, dip) / deep_dip;
  return {deep, std::max(0.0, pip - deep_pip * deep) / superficial_pip};
}

/// Forces on pulleys [N].
struct PulleyForces {
  double a2 = 0, a4 = 0;
};

/// @param pip angle of the PIP [rad]
inline PulleyForces pulley_forces(const FlexorTensions& tensions, double pip) {
  const double turn = 2 * std::sin(std::max(0.0, pip) / 4);
  return {turn * (tensions.deep + tensions.superficial), turn * tensions.deep};
}

/// Tension beyond the PIP's pulleys over the muscle's where the finger yields, a belt: a PIP of 83 deg then
/// has 11 % more moment than where it pulls, with one over it (Schweizer 2009, J Biomech 42:1856).
inline double sheath_gain(double pip) { return std::exp(0.036 * std::max(0.0, pip)); }

}  // namespace handsim::model
