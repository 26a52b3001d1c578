// What changes: body poses and velocities at a time. Engines write it, everyone else reads it.
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
};

/// Names time and bodies to an archive (core/archive.h); the number of bodies is the model's.
template <class Archive, class T>
void carry(Archive& archive, T& state) {
  archive(state.time);
  for (auto& body : state.bodies) {
    archive(body.p);
    archive(body.q);
    archive(body.v);
    archive(body.w);
  }
}

}  // namespace handsim::model
