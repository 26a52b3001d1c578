#include "handsim/engine/ode/bodies.h"

#include <algorithm>

#include "handsim/engine/ode/world_resources.h"

namespace handsim::engine::ode {

namespace {

dBodyID make_kinematic(dWorldID world) {
  const dBodyID id = dBodyCreate(world);
  dBodySetKinematic(id);
  dBodySetGyroscopicMode(id, 0);
  // Exact rotation by w h, so that a driven body meets its pose at the end of the step.
  dBodySetFiniteRotationMode(id, 1);
  return id;
}

/// The immovable bodies that joints need as ODE bodies: children of joints with a movable parent.
std::vector<bool> closed_onto(const model::Model& model, const std::vector<bool>& immovable) {
  std::vector<bool> needed(model.bodies.size(), false);
  for (const model::Joint& joint : model.joints)
    if (!immovable[as_index(joint.parent)]) needed[as_index(joint.child)] = true;
  return needed;
}

void set_velocity(dBodyID id, const Vec3& v, const Vec3& w) {
  dBodySetLinearVel(id, v.x(), v.y(), v.z());
  dBodySetAngularVel(id, w.x(), w.y(), w.z());
}

}  // namespace

void set_mass(dBodyID id, const model::Body& body) {
  const Mat3& I = body.inertia;
  dMass mass;
  dMassSetParameters(&mass, body.mass, 0, 0, 0, I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2));
  dBodySetMass(id, &mass);
}

OdeIds make_world() {
  OdeIds ids;
  ids.threading.reset(dThreadingAllocateSelfThreadedImplementation());
  ids.world.reset(dWorldCreate());
  dWorldSetStepThreadingImplementation(
      ids.world.get(), dThreadingImplementationGetFunctions(ids.threading.get()), ids.threading.get());
  guard_step_memory(ids.world.get());
  return ids;
}

OdeBody handle(dBodyID id) {
  // ODE hands out const pointers to its own storage; writing there is the only bit-exact way in.
  const auto own = [](const double* of_ode) { return const_cast<double*>(of_ode); };
  return {id,
          own(dBodyGetPosition(id)),
          own(dBodyGetQuaternion(id)),
          own(dBodyGetRotation(id)),
          own(dBodyGetLinearVel(id)),
          own(dBodyGetAngularVel(id)),
          false,
          {}};
}

std::vector<OdeBody> make_bodies(dWorldID world, const model::Model& model,
                                 const std::vector<bool>& immovable) {
  const std::vector<bool> needed = closed_onto(model, immovable);
  std::vector<OdeBody> bodies(model.bodies.size());
  for (std::size_t i = 1; i < bodies.size(); ++i) {
    const model::Body& body = model.bodies[i];
    if (!body.kinematic) {
      bodies[i] = handle(dBodyCreate(world));
      set_mass(bodies[i].id, body);
    } else if (!immovable[i] || needed[i]) {
      bodies[i] = handle(make_kinematic(world));
      bodies[i].driven = !immovable[i];
    }
  }
  std::vector<int> hanging(bodies.size(), 0);
  for (const model::Joint& joint : model.joints) {
    OdeBody& parent = bodies[as_index(joint.parent)];
    if (parent.driven && hanging[as_index(joint.parent)]++ > 0)
      parent.copies.push_back(make_kinematic(world));
  }
  return bodies;
}

void write_state(const OdeBody& body, const model::BodyState& state) {
  if (body.id == nullptr) return;
  const dQuaternion q = {state.q.w(), state.q.x(), state.q.y(), state.q.z()};
  std::copy(q, q + 4, body.q);
  dQtoR(q, body.R);
  std::copy(state.v.data(), state.v.data() + 3, body.v);
  std::copy(state.w.data(), state.w.data() + 3, body.w);
  // Copies the position as it is and tells the body's geoms that it moved.
  dBodySetPosition(body.id, state.p.x(), state.p.y(), state.p.z());
  for (const dBodyID copy : body.copies) write_state(handle(copy), state);
}

model::BodyState read_state(const OdeBody& body) {
  return {Vec3(body.p[0], body.p[1], body.p[2]), Quat(body.q[0], body.q[1], body.q[2], body.q[3]),
          Vec3(body.v[0], body.v[1], body.v[2]), Vec3(body.w[0], body.w[1], body.w[2])};
}

StepStart step_start(const OdeBody& body) {
  return {read_state(body), Eigen::Map<const Vec3>(dBodyGetForce(body.id)),
          Eigen::Map<const Vec3>(dBodyGetTorque(body.id))};
}

void put_back(const OdeBody& body, const StepStart& start) {
  write_state(body, start.state);
  dBodySetForce(body.id, start.force.x(), start.force.y(), start.force.z());
  dBodySetTorque(body.id, start.torque.x(), start.torque.y(), start.torque.z());
}

std::vector<StepForecast::Driven> drive(const model::Model& model, const std::vector<OdeBody>& bodies,
                                        std::span<const Pose> targets, double remaining, double step) {
  std::vector<StepForecast::Driven> out;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const OdeBody& body = bodies[as_index(model.drives[i].body)];
    if (!body.driven) continue;
    const Pose target = targets[i] * model.drives[i].frame.inverse();
    const model::BodyState now = read_state(body);
    const Vec3 v = (target.p - now.p) / remaining;
    const Vec3 w = rotation_vector(target.q * now.q.conjugate()) / remaining;
    out.push_back({model.drives[i].body, {step * v, step * w}});
    set_velocity(body.id, v, w);
    for (const dBodyID copy : body.copies) set_velocity(copy, v, w);
  }
  return out;
}

}  // namespace handsim::engine::ode
