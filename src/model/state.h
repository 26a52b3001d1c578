// What changes: how bodies and joints stand and move at a time, and what acted along the joints in the step
// that led there. Engines write it, everyone else reads it.
#pragma once

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

struct State {
  double time = 0;                ///< [s]
  std::vector<BodyState> bodies;  ///< as Model::bodies; [0], the world, stays at rest at the origin

  // By coordinate, size Model::dof_count(). q and u state the same motion as `bodies`: an engine that is
  // handed a state finds them anew.
  std::vector<double> q;  ///< coordinates as in kinematics.h, angles in (-pi, pi] [rad] or [m]
  std::vector<double> u;  ///< rates as in kinematics.h [rad/s] or [m/s]
  /// Torque that acted on the child in the last step, positive along the coordinate, its mean over the step
  /// where the engine holds it constant (ode), else its value at the step's end: given torques, servos and
  /// passive tissue as the engine solved them. Without the forces of stops, contacts and the joint's own
  /// constraints. Of a ball: the given torque in F. Zero before the first step [N m] or [N].
  std::vector<double> tau;
  std::vector<double> tau_servo;  ///< the servos' part of tau, within their limits [N m] or [N]
};

/// Names time, bodies and torques to an archive (core/archive.h); the numbers of them are the model's, and q
/// and u follow from the bodies.
template <class Archive, class T>
void carry(Archive& archive, T& state) {
  archive(state.time);
  for (auto& body : state.bodies) {
    archive(body.p);
    archive(body.q);
    archive(body.v);
    archive(body.w);
  }
  archive.each(state.tau);
  archive.each(state.tau_servo);
}

}  // namespace handsim::model
