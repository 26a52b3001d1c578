// What a LaneGroup needs of an engine whose steps it takes.
#include <algorithm>

#include "handsim/engine/articulated/articulated_engine.h"
#include "handsim/engine/checks.h"
#include "handsim/engine/collision/ode_library.h"

namespace handsim::engine::articulated {

bool ArticulatedEngine::suits_lanes() const {
  const std::vector<Node>& nodes = mechanism_.topology().nodes;
  return fast_spin_ && !momentum_.jointed() && !loops_ && (!muscles_ || muscles_->single()) && !failure_ &&
         !nodes.empty() &&
         std::ranges::none_of(nodes, [](const Node& node) { return node.kind == NodeKind::ball; });
}

bool ArticulatedEngine::stands() {
  if (failure_) return false;
  for (const model::Drive& drive : drives())
    if (drive.motion.keys.size() > 1 || !drive.motion.shakes.empty()) return false;
  compute_targets({}, next_time(time_, settings_.step));
  for (std::size_t i = 0; i < drives().size(); ++i) {
    const BaseMotion& base = mechanism_.base(ways_[i].body);
    for (const Vec3& v : {ways_[i].way.shift, ways_[i].way.turn, base.v, base.w, base.dv, base.dw})
      if (!v.isZero(0)) return false;
  }
  return true;
}

model::State& ArticulatedEngine::state_in_lanes() {
  phase_.store(Phase::stepped, std::memory_order_relaxed);
  return state_;
}

bool ArticulatedEngine::find_contacts() {
  try {
    collide_calls_ =
        contact_->collide(state_, {settings_.step, settings_.step * mechanism_.gravity(), ways_});
  } catch (const OdeFault&) {
    // The step alone reports it.
    return false;
  }
  return true;
}

void ArticulatedEngine::arrive_from_lanes(double time, bool with_bodies) {
  fast_spin_->forget();
  if (contact_) contact_->forget();
  time_ = time;
  placed_ = false;
  if (with_bodies) give_rest();
  if (with_bodies && muscles_) muscles_->give(state_);
  phase_.store(with_bodies ? Phase::stated : Phase::stepped, std::memory_order_relaxed);
}

}  // namespace handsim::engine::articulated
