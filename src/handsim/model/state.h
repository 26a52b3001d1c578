// State of a model at a time: bodies, joint coordinates and rates, last joint torques. Only engines write it.
#pragma once

#include <array>
#include <vector>

#include "handsim/model/model.h"

namespace handsim::model {

struct BodyState {
  Vec3 p = Vec3::Zero();      ///< centre of mass in the world [m]
  Quat q = Quat::Identity();  ///< q_WB
  Vec3 v = Vec3::Zero();      ///< velocity of the centre of mass, world axes [m/s]
  Vec3 w = Vec3::Zero();      ///< angular velocity, world axes [rad/s]

  Pose pose() const { return {p, q}; }
};

/// What is left of the pressing of a pad: of a pair of shapes that touches, or has parted not long ago.
struct PadState {
  int shape_a = 0, shape_b = 0;
  double force = 0;                              ///< elastic [N]
  double push = 0;                               ///< with what relaxes [N]
  std::array<double, kMostRelaxations> parts{};  ///< of the force, that relax [N]; model/compliance.h: q_k
};

struct State {
  double time = 0;                ///< [s]
  std::vector<BodyState> bodies;  ///< as Model::bodies; [0], the world, stays at rest at the origin

  // By coordinate, size Model::dof_count(). q and u say the same as `bodies`: an engine recomputes them.
  std::vector<double> q;  ///< coordinates as in kinematics.h, angles in (-pi, pi] [rad] or [m]
  std::vector<double> u;  ///< rates as in kinematics.h [rad/s] or [m/s]
  /// Torque on the child in the last step, positive along the coordinate [N m] or [N]: given torques, servos
  /// and passive tissue as the engine solved them, without stops, contacts and joint constraints. In the step
  /// constant with engine ode, at its end with others. Ball: the given torque in F. 0 before the first step.
  std::vector<double> tau;
  std::vector<double> tau_servo;  ///< the servos' part of tau, within their limits [N m] or [N]

  // By muscle, size of Model::muscles.
  std::vector<double> activation;    ///< 0..1
  std::vector<double> fibre_length;  ///< at the time [m]
  std::vector<double> fibre_speed;   ///< lengthening, at the end of the last step [m/s]
  /// Of cross-bridges, where fibres have a short-range stiffness, else 0 [optimal fibre lengths].
  std::vector<double> bridge_stretch;
  std::vector<double> tendon_force;  ///< tension in the last step, at its end [N]

  std::vector<PadState> pads;  ///< of surfaces with a law of compliance; ascending by their shapes
};

/// Serialises time, bodies, torques, muscles and pads (core/archive.h); the model has the counts of the first
/// ones, q and u follow.
template <class Archive, class T>
void serialize(Archive& archive, T& state) {
  archive(state.time);
  for (auto& body : state.bodies) {
    archive(body.p, body.q, body.v, body.w);
  }
  archive.each(state.tau);
  archive.each(state.tau_servo);
  for (auto* values : {&state.activation, &state.fibre_length, &state.fibre_speed, &state.bridge_stretch,
                       &state.tendon_force})
    archive.each(*values);
  archive.list(state.pads, [](auto& to, auto& pad) {
    to(pad.shape_a, pad.shape_b, pad.force, pad.push);
    to.each(pad.parts);
  });
}

}  // namespace handsim::model
