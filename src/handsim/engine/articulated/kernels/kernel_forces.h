// The forces of a step, and the stops and torque limits that are in force in it.
#pragma once

#include "handsim/engine/articulated/kernels/lanes.h"

namespace handsim::engine::articulated {

template <class V>
struct Forces : Lanes<V> {
  using L = Lanes<V>;
  using L::W, L::load, L::store, L::batches, L::axis, L::servo, L::single;
  using typename L::Batches, typename L::Axes;
  /// Beyond these a limit of torque [of it] and a stop [rad or m] come into force.
  static constexpr double kLoose = 1.0 + 1e-9, kTouch = 1e-12;

  /// A spring-damper evaluated at the end of the step, F = F0 - k h u' - d u' with u' = u + h du, is
  /// F0 - (h k + d) u on the right and h (h k + d) on the joint-space inertia's diagonal.
  [[gnu::always_inline]] static void prepare_axis(const LaneTree& tree, const Batches& b, double step) {
    const V h = step;
    Axes& a = axis(tree, b);
    const V q = load(tree.q + b.q), u = load(tree.u + b.u);
    const V k = load(a.stiffness);
    const V damping = h * k + load(a.damping);
    const model::ServoOf<V> drive = servo(a);
    const V saturated = load(a.saturated);
    const V on = V(1.0) - saturated * saturated;
    store(a.force, load(a.tau) - k * (q - load(a.rest)) - damping * u + on * drive.start(h, u) +
                       saturated * drive.limit);
    // An empty lane has to have some inertia.
    store(a.weight, h * (damping + on * drive.slope(h)) + (V(1.0) - load(a.present)));
    lock_at_stops(tree, b, a, step);
  }

  static void prepare(const LaneTree& tree, double step) {
    for (int i = 0; i < tree.batches; ++i)
      if (const Batches& b = batches(tree)[i]; single(b)) prepare_axis(tree, b, step);
  }

  static void compute_torque(const LaneTree& tree, const Batches& b, double step) {
    const V h = step;
    const V u = load(tree.u + b.u) + h * load(tree.du + b.u);
    store_torque(tree, b, load(tree.q + b.q) + h * u, u, h * u);
  }

  /// tau and tau_servo of a position and a rate. @param moved since the servo's error was found
  static V store_torque(const LaneTree& tree, const Batches& b, const V& q, const V& u, const V& moved) {
    const Axes& a = axis(tree, b);
    const model::ServoOf<V> drive = servo(a);
    const V least = V(0.0) - drive.limit;
    V pull = drive.pull(moved, u);
    pull = articulated::select(pull > drive.limit, drive.limit, pull);
    pull = articulated::select(pull < least, least, pull);
    const V tau = load(a.tau) - load(a.stiffness) * (q - load(a.rest)) - load(a.damping) * u + pull;
    store(tree.tau_servo + b.u, pull);
    store(tree.tau + b.u, tau);
    return tau;
  }

  static void compute_torques(const LaneTree& tree, double step) {
    for (int i = 0; i < tree.batches; ++i)
      if (const Batches& b = batches(tree)[i]; single(b)) compute_torque(tree, b, step);
  }

  static void prepare_smooth(const LaneTree& tree) {
    const V zero = 0.0;
    for (int i = 0; i < tree.batches; ++i) {
      const Batches& b = batches(tree)[i];
      if (!single(b)) continue;
      Axes& a = axis(tree, b);
      const V q = load(tree.q + b.q), u = load(tree.u + b.u);
      store(a.force, store_torque(tree, b, q, u, q));
      store(a.weight, V(1.0) - load(a.present));
      store(a.locked, V(1.0) - load(a.present));
      store(a.given, zero);
    }
  }

  static void work(const LaneTree& tree, double step) {
    const V h = step, half = 0.5 * step;
    for (int i = 0; i < tree.batches; ++i) {
      const Batches& b = batches(tree)[i];
      if (!single(b)) continue;
      Axes& a = axis(tree, b);
      const V du = load(tree.du + b.u);
      const V force = load(a.force) - load(a.weight) * du + load(a.reaction);
      store(a.work, h * force * (load(tree.u + b.u) + half * du));
    }
  }

  /// Compares an axis with its assumed stop and limit. True where nothing was wrong: mostly nothing is in
  /// force, nor comes to be.
  [[gnu::always_inline]] static bool correct(const LaneTree& tree, const Batches& b, double step,
                                             bool only_first) {
    const V h = step, zero = 0.0, loose = kLoose, touch = kTouch;
    const Axes& a = axis(tree, b);
    const V q = load(tree.q + b.q), u1 = load(tree.u + b.u) + h * load(tree.du + b.u);
    const model::ServoOf<V> drive = servo(a);
    const V pull = drive.pull(h * u1, u1), bound = drive.limit * loose, then = q + h * u1;
    const V side = load(a.side), was = load(a.saturated), low = load(a.low), high = load(a.high);
    const auto free = side == zero && was == zero && q >= low && q <= high && then >= low - touch &&
                      then <= high + touch && pull <= bound && pull >= V(zero - bound);
    return !any(!free) || correct_any(tree, b, step, only_first);
  }

  static bool correct_any(const LaneTree& tree, const Batches& b, double step, bool only_first) {
    const V h = step, one = 1.0, zero = 0.0;
    const V tight = 1.0 - 1e-9, loose = kLoose, touch = kTouch;
    Axes& a = axis(tree, b);
    const V q = load(tree.q + b.q), u = load(tree.u + b.u), u1 = u + h * load(tree.du + b.u);
    const model::ServoOf<V> drive = servo(a);
    const V was = load(a.saturated), pull = drive.pull(h * u1, u1);
    const V bound = drive.limit * articulated::select(was * was > zero, tight, loose);
    V now = articulated::select(pull > bound, one, zero);
    now = articulated::select(pull < V(zero - bound), V(zero - one), now);
    const V side = load(a.side), low = load(a.low), high = load(a.high);
    const V then = q + h * u1, share = tree.erp;
    // From beyond a stop, the way back takes several steps.
    const V least = articulated::select(q < low, V(q + share * (low - q)), low);
    const V most = articulated::select(q > high, V(q + share * (high - q)), high);
    V reached = articulated::select(then < least - touch, V(zero - one), zero);
    reached = articulated::select(then > most + touch, one, reached);
    // A stop pushes inward only: up from the low end, down from the high one.
    const V held = articulated::select(side * load(a.reaction) <= zero, side, zero);
    reached = articulated::select(side * side > zero, held, reached);
    const auto wrong = (now != was) || (reached != side);
    if (!any(wrong)) return true;
    if (only_first) {
      correct_first(a, now, reached);
    } else {
      store(a.saturated, now);
      store(a.side, reached);
    }
    return false;
  }

  static bool update_active_set(const LaneTree& tree, double step, bool only_first) {
    bool sound = true;
    for (int i = 0; i < tree.batches; ++i) {
      const Batches& b = batches(tree)[i];
      if (!single(b) || correct(tree, b, step, only_first)) continue;
      if (only_first) return false;
      sound = false;
    }
    return sound;
  }

  static void correct_first(Axes& a, const V& now, const V& reached) {
    alignas(64) Lane<W> saturated, side;
    store(saturated, now);
    store(side, reached);
    for (int lane = 0; lane < W; ++lane) {
      if (saturated[lane] == a.saturated[lane] && side[lane] == a.side[lane]) continue;
      if (saturated[lane] != a.saturated[lane])
        a.saturated[lane] = saturated[lane];
      else
        a.side[lane] = side[lane];
      return;
    }
  }

  /// Locks what is on a stop: to land on it, to come back into the range, or to bounce off.
  static void lock_at_stops(const LaneTree& tree, const Batches& b, Axes& a, double step) {
    const V zero = 0.0, h = step;
    const V side = load(a.side), q = load(tree.q + b.q), u = load(tree.u + b.u);
    const auto on = side * side > zero;
    if (!any(on)) {
      store(a.locked, V(1.0 - load(a.present)));
      store(a.given, zero);
      return;
    }
    const V end = articulated::select(side < zero, load(a.low), load(a.high));
    // Along the way out: how far there is to go, and how fast it goes.
    const V room = articulated::select(side < zero, V(q - end), V(end - q));
    const V speed = side * u;
    V target = articulated::select(room < zero, V(tree.erp * room / h), V(room / h));
    // A rebound ends on the opposite stop at the latest.
    const V across = (room - (load(a.high) - load(a.low))) / h;
    V bounced = V(zero - load(a.restitution)) * speed;
    bounced = articulated::select(bounced < across, across, bounced);
    target =
        articulated::select(speed > zero && bounced < target && load(a.restitution) > zero, bounced, target);
    store(a.locked, articulated::select(on, V(1.0), V(1.0 - load(a.present))));
    store(a.given, articulated::select(on, V((side * target - u) / h), zero));
  }
};

}  // namespace handsim::engine::articulated
