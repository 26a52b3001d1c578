#include "handsim/engine/ode/drives.h"

namespace handsim::engine::ode {

namespace {

void set_velocity(dBodyID id, const Vec3& v, const Vec3& w) {
  dBodySetLinearVel(id, v.x(), v.y(), v.z());
  dBodySetAngularVel(id, w.x(), w.y(), w.z());
}

}  // namespace

Drives::Drives(const model::Model& model, const std::vector<OdeBody>& bodies)
    : model_(model), bodies_(bodies) {}

void Drives::set_velocities(double end, double step) {
  ways_.clear();
  for (const model::Drive& drive : model_.drives) set_velocity(drive, drive.motion.at(end), step, step);
}

void Drives::set_velocities(std::span<const Pose> targets, double remaining, double step) {
  ways_.clear();
  for (std::size_t i = 0; i < targets.size(); ++i)
    set_velocity(model_.drives[i], targets[i], remaining, step);
}

void Drives::set_velocity(const model::Drive& drive, const Pose& frame, double remaining, double step) {
  const OdeBody& body = bodies_[static_cast<std::size_t>(drive.body)];
  if (!body.driven) return;
  const Pose target = frame * drive.frame.inverse();
  const model::BodyState now = read_state(body);
  const Vec3 v = (target.p - now.p) / remaining;
  const Vec3 w = rotation_vector(target.q * now.q.conjugate()) / remaining;
  ways_.push_back({drive.body, {step * v, step * w}});
  ode::set_velocity(body.id, v, w);
  for (const dBodyID copy : body.copies) ode::set_velocity(copy, v, w);
}

}  // namespace handsim::engine::ode
