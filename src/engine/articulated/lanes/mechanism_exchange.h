// A mechanism's numbers to a lane beside other mechanisms, and back. Included by lane_group.cpp only.
#pragma once

#include "handsim/engine/articulated/lanes/lane_tree.h"

namespace handsim::engine::articulated {

/// One lane of `count` numbers.
template <int W, int N>
void copy_lane(const Lane<W>* from, int lane, Lane<N>* to, int to_lane, std::ptrdiff_t count) {
  for (std::ptrdiff_t i = 0; i < count; ++i) to[i][to_lane] = from[i][lane];
}

template <int N>
void Mechanism::lend_constants(LaneTree<N>& to, int lane) const {
  in_lanes([&](auto in) {
    constexpr int W = in.kWidth;
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      const LaneSlot& slot = slots_[i];
      const auto& b = in.batch[slot.batch];
      Batch<N>& out = to.batches[i];
      copy_lane<W, N>(b.before, slot.lane, out.before, lane, &b.sine - &b.before[0]);
      if (!single(b.kind)) continue;
      const auto& a = in.axis[b.axis];
      copy_lane<W, N>(&a.stiffness, slot.lane, &to.axes[at(out.axis)].stiffness, lane, &a.tau - &a.stiffness);
    }
  });
  for (const Carried& each : carried_) put4<N>(to.bodies[at(each.body)].q_LB, lane, each.q_LB);
  lend_bases(to, lane);
}

template <int N>
void Mechanism::lend_bases(LaneTree<N>& to, int lane) const {
  in_lanes([&](auto in) {
    constexpr int W = in.kWidth;
    constexpr auto kFrame = static_cast<std::ptrdiff_t>(sizeof(Frame<W>) / sizeof(Lane<W>));
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      const auto& b = in.batch[slots_[i].batch];
      if (b.link != ParentLink::base) continue;
      Frame<N>& frame = to.bases[at(to.batches[i].parent)];
      copy_lane<W, N>(in.base[b.parent].quat, slots_[i].lane, frame.quat, lane, kFrame);
    }
  });
  for (std::size_t i = 0; i < bases_.size(); ++i) {
    if (to.bodies[i].of_node) continue;
    put3<N>(to.bodies[i].p, lane, bases_[i].pose.p);
    put4<N>(to.bodies[i].q, lane, bases_[i].pose.q);
  }
  for (int i = 0; i < topology_.islands; ++i)
    for (int k = 0; k < 3; ++k) to.origins[at(3 * i + k)].x[lane] = origin(i)[k];
}

/// Calls copy(own, other) with each number of the motion. @param all_torques those of balls, too
template <int N, class Other, class Copy>
void Mechanism::exchange(Other& with, int lane, bool all_torques, const Copy& copy) const {
  in_lanes([&](auto in) {
    constexpr int W = in.kWidth;
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      const LaneSlot& slot = slots_[i];
      const auto& b = in.batch[slot.batch];
      const Batch<N>& other = with.batches[i];
      for (std::size_t k = 0; k < at(position_count(b.kind)); ++k)
        copy(tree_.q[slot.q + k * W], with.tree.q[at(other.q) + k * N + at(lane)]);
      for (std::size_t k = 0; k < at(rate_count(b.kind)); ++k) {
        const std::size_t own = slot.u + k * W, u = at(other.u) + k * N + at(lane);
        copy(tree_.u[own], with.tree.u[u]);
        if (!all_torques && !single(b.kind)) continue;
        copy(tree_.tau[own], with.tree.tau[u]);
        copy(tree_.tau_servo[own], with.tree.tau_servo[u]);
      }
      if (!single(b.kind)) continue;
      auto& axis = with.axes[at(other.axis)];
      copy(in.axis[b.axis].side[slot.lane], axis.side[lane]);
      copy(in.axis[b.axis].saturated[slot.lane], axis.saturated[lane]);
    }
  });
}

template <int N>
void Mechanism::lend(LaneTree<N>& to, int lane) const {
  bool moved = false;
  for (std::size_t i = 0; i < bases_.size(); ++i)
    moved = moved ||
            (!to.bodies[i].of_node && (get3<N>(to.bodies[i].p, lane) != bases_[i].pose.p ||
                                       get4<N>(to.bodies[i].q, lane).coeffs() != bases_[i].pose.q.coeffs()));
  if (moved) lend_bases(to, lane);
  exchange<N>(to, lane, true, [](const double& own, double& other) { other = own; });
}

template <int N>
void Mechanism::take_back(const LaneTree<N>& from, int lane) {
  exchange<N>(from, lane, false, [](double& own, const double& other) { own = other; });
  // The tree holds what it was last given, not what the next step is given.
  servos_at_rest_ = false;
}

}  // namespace handsim::engine::articulated
