// The ODE ids of one engine and their single owner; bodies built from a Model, their state read and
// written bit for bit. A body that never moves (the world, kinematic bodies without an acting drive) has
// no ODE body: what hangs on it hangs on ODE's world, so that each finger of a still palm is an island of
// its own (the direct solver's cost grows with the cube of an island's rows).
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <ode/ode.h>

#include "handsim/engine/collision/ode_library.h"
#include "handsim/engine/collision/sweep.h"
#include "handsim/engine/engine.h"

namespace handsim::engine::ode {

/// Owns all ODE objects of an engine; bodies and joints die with the world. Move-only.
struct OdeIds {
  /// Runs this world's steps in the calling thread. ODE's default is one for all worlds, without a lock:
  /// steps in two threads crash, and a step left by an exception leaves its jobs to other worlds.
  std::unique_ptr<dxThreadingImplementation, Destroyer<dThreadingFreeImplementation>> threading;
  std::unique_ptr<dxWorld, Destroyer<dWorldDestroy>> world;
  std::unique_ptr<dxJointGroup, Destroyer<dJointGroupDestroy>> contact_joints;  ///< with the space only
};

/// An ODE body and its state in place.
struct OdeBody {
  dBodyID id = nullptr;  ///< null: never moves
  double* p = nullptr;   ///< position, 3
  double* q = nullptr;   ///< quaternion w, x, y, z
  double* R = nullptr;   ///< rotation matrix, 3 rows of 4
  double* v = nullptr;   ///< velocity, 3
  double* w = nullptr;   ///< angular velocity, 3
  bool driven = false;
  /// Kinematic bodies that repeat this driven one for each further joint: its children's islands stay apart.
  std::vector<dBodyID> copies;
};

/// A world with threading of its own.
OdeIds make_world();

/// Gives an ODE body the mass and inertia of the model's.
void set_mass(dBodyID id, const model::Body& body);
/// Creates the bodies, in the order of Model::bodies, at the origin. @throws OdeFault
std::vector<OdeBody> make_bodies(dWorldID world, const model::Model& model,
                                 const std::vector<bool>& immovable);
OdeBody handle(dBodyID id);

/// Sets pose and velocities to the very bits given; the rotation matrix is what ODE derives from q.
void write_state(const OdeBody& body, const model::BodyState& state);
model::BodyState read_state(const OdeBody& body);

/// The start of a step of ODE: a body's state, and the force [N] and torque [N m] on it, in world axes.
struct StepStart {
  model::BodyState state;
  Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
};
StepStart step_start(const OdeBody& body);
void put_back(const OdeBody& body, const StepStart& start);

/// Gives driven bodies the velocities that carry them to X_WD of their drives in `remaining` [s] from now.
/// The error of one step is made good in the next, so none adds up.
/// @param targets by drive @param step that is to come [s] @return where the bodies go in it
std::vector<StepForecast::Driven> drive(const model::Model& model, const std::vector<OdeBody>& bodies,
                                        std::span<const Pose> targets, double remaining, double step);

}  // namespace handsim::engine::ode
