// Forces on the flexor pulleys of a finger from its tendons' tensions and its PIP angle. A2 and A4 stand on
// both sides of the PIP; the tendons turn there by the angle of the joint, 0.55 of it at A2. A tendon of
// tension T that turns by an angle t presses with 2 T sin(t / 2). The superficial flexor ends between the two
// and loads A2 alone. Deep tendons of cadavers had 348 N at failure in a crimp, A2 287 N and A4 226 N; in a
// slope grip 371, 121 and 103 N (Schoeffl 2009, J Biomech 42:2183). By these forces they turned by 87 and 35
// deg, of which A2 had 0.56 and 0.54; at PIP angles of 87 and 39 deg (Fischer 2024, Bioengineering 11:370)
// the law gives 282 and 233 N, 138 and 113 N. Bowstringing is left out, and friction but for sheath_gain().
#pragma once

#include <algorithm>
#include <cmath>

namespace handsim::model {

/// Largest forces on A2 and A4 [N]: of 12 cadaver fingers loaded in a crimp until something tore (Schoeffl
/// 2009). In half of them that was A4.
inline constexpr double kA2Strength = 287, kA4Strength = 226;
inline constexpr double kA2Turn = 0.55;  ///< share of the PIP's angle by which tendons turn at A2

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
  const auto turned = [&](double share) { return 2 * std::sin(share * std::max(0.0, pip) / 2); };
  return {turned(kA2Turn) * (tensions.deep + tensions.superficial), turned(1 - kA2Turn) * tensions.deep};
}

/// Tension beyond the PIP's pulleys over the muscle's where the finger yields, a belt: a PIP of 83 deg then
/// has 11 % more moment than where it pulls, with one over it (Schweizer 2009, J Biomech 42:1856).
inline double sheath_gain(double pip) { return std::exp(0.036 * std::max(0.0, pip)); }

}  // namespace handsim::model
