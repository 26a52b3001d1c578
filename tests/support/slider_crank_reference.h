// The reference solution that tests and the accuracy study compare with: the spatial slider-crank of the
// IFToMM benchmark library, reduced exactly to its one degree of freedom, the crank angle, and integrated
// with error control by SUNDIALS CVODE. Independent of Model and engines.
#pragma once

#include <span>
#include <vector>

namespace handsim::study {

/// The mechanism. Crank on a hinge about world x, rod, slider on the world x axis; a ball joint at the pin,
/// a universal joint at the slider. Defaults: IFToMM Library of Computational Benchmark Problems (Haug 1989).
struct SliderCrankSpec {
  double axis_y = 0.1, axis_z = 0.12;  ///< the crank's hinge axis, parallel to x [m]
  double crank_length = 0.08;          ///< hinge to pin [m]
  double crank_mass = 0.12;            ///< centre of mass in its middle [kg]
  double crank_inertia = 1e-4;         ///< about its centre of mass, across its length [kg m^2]
  double rod_length = 0.3;             ///< pin to slider; the slider must not reach x = 0 [m]
  double rod_mass = 0.5;               ///< centre of mass in its middle [kg]
  double rod_inertia = 4e-3;           ///< about its centre of mass, across its length [kg m^2]
  double rod_axial_inertia = 4e-4;     ///< along its length [kg m^2]
  double slider_mass = 2;              ///< [kg]
  double gravity = 9.81;               ///< along -z [m/s^2]; the benchmark's value
  double torque = 0;                   ///< on the crank, about +x [N m]
  double angle = 0;                    ///< crank angle at the start [rad]
  double speed = 0;                    ///< crank speed at the start [rad/s]

  /// Crank up, 6 rad/s. Published over 5 s.
  static SliderCrankSpec iftomm();
  /// From rest at 90 deg under 0.1 N m, over 2 s.
  static SliderCrankSpec constant_torque();
};

/// The mechanism at one time.
struct SliderCrankState {
  double time = 0;    ///< [s]
  double theta = 0;   ///< crank angle [rad]: 0 along +z, positive about +x; counts full turns
  double omega = 0;   ///< crank speed [rad/s]
  double x = 0;       ///< slider [m]
  double vx = 0;      ///< slider [m/s]
  double energy = 0;  ///< kinetic and potential energy minus the work of the torque [J]: constant
};

class SliderCrankReference {
 public:
  /// @throws Error (input) for a rod so short that the slider can reach x = 0, or masses that are not
  /// positive.
  explicit SliderCrankReference(const SliderCrankSpec& spec);

  /// States at increasing times [s], from 0 on. The tolerance of each step is 3e-15; the error after the 5 s
  /// of `iftomm` is below 1e-9 (rad, rad/s, m, m/s).
  /// @throws Error (physics) if the integrator fails, or if the energy changes by more than 1e-10 of the
  ///         largest kinetic energy so far.
  std::vector<SliderCrankState> at(std::span<const double> times) const;
  /// States every `every` seconds from 0 to `duration`, both included.
  std::vector<SliderCrankState> series(double duration, double every) const;

  /// Angular acceleration of the crank [rad/s^2].
  double acceleration(double theta, double omega) const;
  /// The state for a crank angle and speed.
  SliderCrankState state(double time, double theta, double omega) const;

 private:
  SliderCrankSpec spec_;
};

}  // namespace handsim::study
