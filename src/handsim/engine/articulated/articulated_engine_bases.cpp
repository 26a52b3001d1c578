// Bodies that drives move: the bases of a mechanism's trees; and what a state has beside poses of nodes.
#include "handsim/engine/articulated/articulated_engine.h"

namespace handsim::engine::articulated {

/// Where the drives take their bodies in a step that ends at a time. @param given by the caller, or empty
void ArticulatedEngine::compute_targets(std::span<const Pose> given, double end) {
  ways_.clear();
  for (std::size_t i = 0; i < drives().size(); ++i) {
    const model::Drive& drive = drives()[i];
    const Pose& now = mechanism_.base(drive.body).pose;
    const Pose frame = given.empty() ? drive.motion.at(end) : given[i];
    targets_[i] = frame * drive.frame.inverse();
    ways_.push_back(
        {drive.body, {targets_[i].p - now.p, rotation_vector(targets_[i].q * now.q.conjugate())}});
  }
}

/// Gives driven bodies the constant velocities that reach their targets. False where all of them stand still.
bool ArticulatedEngine::set_base_velocities() {
  const double h = settings_.step;
  bool moving = false;
  for (std::size_t i = 0; i < drives().size(); ++i) {
    BaseMotion& base = mechanism_.base(drives()[i].body);
    const Vec3 v = ways_[i].way.shift / h, w = ways_[i].way.turn / h;
    moving = moving || !v.isZero(0) || !w.isZero(0) || !base.v.isZero(0) || !base.w.isZero(0) ||
             !base.dv.isZero(0) || !base.dw.isZero(0);
    base.dv = (v - base.v) / h;
    base.dw = (w - base.w) / h;
    base.v = v;
    base.w = w;
  }
  if (!moving) return false;
  mechanism_.update_bases();
  mechanism_.kernel().velocities(mechanism_.tree());
  return true;
}

void ArticulatedEngine::place_bases() {
  for (std::size_t i = 0; i < drives().size(); ++i) mechanism_.base(drives()[i].body).pose = targets_[i];
  mechanism_.update_bases();
}

/// Bodies, and pads that were pressed: what contacts are found by.
void ArticulatedEngine::write_bodies() const {
  mechanism_.store_state(state_);
  for (const model::Drive& drive : drives()) {
    const BaseMotion& base = mechanism_.base(drive.body);
    state_.bodies[as_index(drive.body)] = {base.pose.p, base.pose.q, base.v, base.w};
  }
  if (contact_) contact_->store_state(state_);
}

}  // namespace handsim::engine::articulated
