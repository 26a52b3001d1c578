// Poses of bodies and control of joints where each lane is an environment of its own: the same bits as
// Mechanism::give, control::GravityLoad and control::Controller, which work on one environment.
#pragma once

#include "handsim/engine/articulated/kernels/lanes.h"

namespace handsim::engine::articulated {

/// Product of quaternions and rotation by one, in the order of sums that Eigen has.
template <class V>
inline Q4<V> product(const Q4<V>& a, const Q4<V>& b) {
  return {
      (a.w * b.x + a.y * b.z) - (a.z * b.y - a.x * b.w), (a.w * b.y + a.y * b.w) + (a.z * b.x - a.x * b.z),
      (a.w * b.z - a.y * b.x) + (a.z * b.w + a.x * b.y), (a.w * b.w - a.y * b.y) - (a.z * b.z + a.x * b.x)};
}
template <class V>
inline V3<V> rotated(const Q4<V>& q, const V3<V>& a) {
  const V3<V> axis = {q.x, q.y, q.z}, half = cross(axis, a), turn = half + half;
  return (a + q.w * turn) + cross(axis, turn);
}

template <class V>
struct LaneControls : Lanes<V> {
  using L = Lanes<V>;
  using L::W, L::load, L::store, L::load3, L::load4, L::store3, L::store4, L::batches, L::axis;
  using typename L::Batches, typename L::Axes, typename L::Frames;

  static void place_bodies(const Tree& tree, const LaneControl& control) {
    auto* bodies = static_cast<LaneBody<W>*>(control.body);
    for (int i = 0; i < control.bodies; ++i) {
      LaneBody<W>& body = bodies[i];
      if (!body.of_node) continue;
      const Frames& frame = batches(tree)[body.batch].frame;
      const double* origin = control.origin + 3 * W * body.island;
      const V3<V> p = load3(frame.p), turn = load3(frame.v);
      store3(body.p, V3<V>{load(origin), load(origin + W), load(origin + 2 * W)} + p);
      const Q4<V> q = product(load4(frame.quat), load4(body.q_LB));
      const V norm = square_root(V((q.x * q.x + q.z * q.z) + (q.y * q.y + q.w * q.w)));
      store4(body.q, {q.x / norm, q.y / norm, q.z / norm, q.w / norm});
      store3(body.v, load3(frame.v + 3) + cross(turn, p));
      store3(body.w, turn);
    }
  }

  static void compute_loads(const LaneControl& control) {
    auto* bodies = static_cast<LaneBody<W>*>(control.body);
    const auto* links = static_cast<const LaneWeight<W>*>(control.weight);
    const V3<V> g = {load(control.gravity), load(control.gravity + W), load(control.gravity + 2 * W)};
    for (int i = 0; i < control.weights; ++i) {
      LaneBody<W>& child = bodies[links[i].child];
      store3(child.moment, load(child.mass) * load3(child.p));
    }
    for (int i = 0; i < control.weights; ++i) {
      const LaneWeight<W>& link = links[i];
      const LaneBody<W>& child = bodies[link.child];
      LaneBody<W>& parent = bodies[link.parent];
      const V3<V> moment = load3(child.moment);
      if (link.adds_to_parent) store3(parent.moment, load3(parent.moment) + moment);
      if (!link.turns) continue;
      const Q4<V> q = load4(child.q);
      const V3<V> anchor = load3(child.p) + rotated(q, load3(link.frame));
      const V3<V> torque = cross(moment - load(link.mass) * anchor, g);
      double* out = control.load + W * link.dof;
      store(out, V(-dot(torque, rotated(load4(parent.q), load3(link.first_axis)))));
      if (link.universal) store(out + W, V(-dot(torque, rotated(q, load3(link.second_axis)))));
    }
  }

  static void command(const Tree& tree, const LaneControl& control, double step) {
    if (control.weights > 0) compute_loads(control);
    const V h = step, zero = 0.0, one = 1.0;
    for (int i = 0; i < control.servos; ++i) {
      LaneServo<W>& servo = static_cast<LaneServo<W>*>(control.servo)[i];
      const Batches& b = batches(tree)[servo.batch];
      Axes& a = axis(tree, b);
      const V target = load(servo.target), error = target - load(tree.q + b.q);
      const V before = load(servo.integral), gain = load(servo.integral_gain), limit = load(servo.limit);
      const V size = articulated::select(error < zero, V(-error), error);
      const auto saturated = load(servo.at_limit) > zero && V(error * load(servo.torque)) > zero;
      V next = before + h * gain * error;
      next = articulated::select(next < V(-limit), V(-limit), articulated::select(limit < next, limit, next));
      const V integral =
          articulated::select(gain > zero && !saturated && size < load(servo.zone), next, before);
      store(servo.integral, integral);
      const V offset = integral + load(control.load + W * servo.dof) +
                       load(servo.tissue_stiffness) * (target - load(servo.tissue_rest));
      const V smoothing = load(servo.smoothing), derivative = load(servo.derivative);
      store(a.servo_stiffness, load(servo.proportional));
      store(a.servo_damping, smoothing * derivative);
      store(a.servo_error, error);
      store(a.servo_feed, offset - (one - smoothing) * derivative * load(servo.filtered_rate));
      store(a.servo_limit, limit);
    }
  }

  static void observe(const Tree& tree, const LaneControl& control) {
    const V zero = 0.0, one = 1.0;
    for (int i = 0; i < control.servos; ++i) {
      LaneServo<W>& servo = static_cast<LaneServo<W>*>(control.servo)[i];
      const Batches& b = batches(tree)[servo.batch];
      const V torque = load(tree.tau_servo + b.u), filtered = load(servo.filtered_rate);
      const V size = articulated::select(torque < zero, V(-torque), torque);
      store(servo.reached, load(servo.target));
      store(servo.torque, torque);
      // A torque at its limit may be rounded below it, as in control::Controller.
      store(servo.at_limit, articulated::select(size >= V(load(servo.limit) * (1 - 1e-9)), one, zero));
      store(servo.filtered_rate, filtered + load(servo.smoothing) * (load(tree.u + b.u) - filtered));
    }
  }
};

}  // namespace handsim::engine::articulated
