// Where the links are and how fast, and the integration that brings them there.
#pragma once

#include "handsim/engine/articulated/kernels/kernel_forces.h"
#include "handsim/engine/articulated/kernels/lanes.h"

namespace handsim::engine::articulated {

template <class V>
struct TreeMotion : Lanes<V> {
  using L = Lanes<V>;
  using L::W, L::load, L::store, L::store_loose, L::load3, L::load6, L::load4, L::load_sym, L::load_mat,
      L::store3, L::store6, L::store4, L::store_sym, L::store_mat, L::batches, L::joint3, L::single,
      L::parent, L::times_rigid;
  using typename L::Batches, typename L::Joints3, typename L::Frames;

  /// Apart from `place`, whose steps wait for each other: these follow closely.
  static void turn(const LaneTree& tree, Batches& b) {
    if (b.kind == NodeKind::revolute) turn_by(load(tree.q + b.q), b);
  }
  [[gnu::always_inline]] static void turn_by(const V& angle, Batches& b) {
    V s, c;
    sine_cosine(V(angle * 0.5), s, c);
    store(b.sine, s);
    store(b.cosine, c);
  }

  static void place(const LaneTree& tree, Batches& b) {
    Frames scratch;
    const Frames& from = parent(tree, b, scratch);
    const double* q = tree.q + b.q;
    Q4<V> quat;
    Mat<V> R;
    V3<V> p;
    switch (b.kind) {
      case NodeKind::revolute: {
        const V s = load(b.sine), c = load(b.cosine);
        const Q4<V> k = load4(b.before), t = load4(b.turned);
        quat = load4(from.quat) *
               Q4<V>{c * k.x + s * t.x, c * k.y + s * t.y, c * k.z + s * t.z, c * k.w + s * t.w};
        const V3<V> o = load3(from.p) + load_mat(from.R) * load3(b.anchor);
        R = rotation(quat);
        const V3<V> axis = R * load3(b.direction);
        p = o + R * load3(b.arm);
        store6(b.S, {axis, cross(o, axis)});
        break;
      }
      case NodeKind::prismatic: {
        quat = load4(from.quat) * load4(b.before);
        const Mat<V> R_from = load_mat(from.R);
        R = rotation(quat);
        const V3<V> axis = R_from * load3(b.direction);
        p = load3(from.p) + R_from * load3(b.anchor) + load(q) * axis + R * load3(b.arm);
        const V zero = 0.0;
        store6(b.S, {{zero, zero, zero}, axis});
        break;
      }
      case NodeKind::ball: {
        const Q4<V> q_WF = load4(from.quat) * load4(b.before);
        quat = q_WF * unit({load(q), load(q + W), load(q + 2 * W), load(q + 3 * W)}) *
               load4(joint3(tree, b).after);
        const V3<V> o = load3(from.p) + load_mat(from.R) * load3(b.anchor);
        const Mat<V> R_F = rotation(q_WF);
        R = rotation(quat);
        p = o + R * load3(b.arm);
        Joints3& joint = joint3(tree, b);
        const V3<V> axes[3] = {
            {R_F.r0.x, R_F.r1.x, R_F.r2.x}, {R_F.r0.y, R_F.r1.y, R_F.r2.y}, {R_F.r0.z, R_F.r1.z, R_F.r2.z}};
        for (int k = 0; k < 3; ++k) store6(joint.S[k], {axes[k], cross(o, axes[k])});
        break;
      }
      case NodeKind::free: {
        // O is where the body is.
        quat = unit({load(q + 3 * W), load(q + 4 * W), load(q + 5 * W), load(q + 6 * W)});
        const V zero = 0.0;
        for (int k = 0; k < 6; ++k)
          for (int i = 0; i < 6; ++i) store(joint3(tree, b).S[k][i], V(i == k ? 1.0 : 0.0));
        R = rotation(quat);
        p = {zero, zero, zero};
        break;
      }
    }
    set_pose(b, quat, R, p);
  }

  static Q4<V> unit(const Q4<V>& q) {
    const V scale = V(1.0) / square_root(V(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w));
    return {scale * q.x, scale * q.y, scale * q.z, scale * q.w};
  }

  /// Pose and inertia of the link: I_O = sum over principal axes e of I_e e e^T + m (p.p 1 - p p^T).
  [[gnu::always_inline]] static void set_pose(Batches& b, const Q4<V>& quat, const Mat<V>& R,
                                              const V3<V>& p) {
    store4(b.frame.quat, quat);
    store_mat(b.frame.R, R);
    store3(b.frame.p, p);
    if (b.massless) return;
    const V mass = load(b.mass);
    const V3<V> moments = load3(b.inertia), h = mass * p;
    const auto entry = [&](const V3<V>& a, const V3<V>& c) {
      return moments.x * a.x * c.x + moments.y * a.y * c.y + moments.z * a.z * c.z;
    };
    const V xx = h.x * p.x, yy = h.y * p.y, zz = h.z * p.z;
    store3(b.h, h);
    store_sym(b.I,
              {entry(R.r0, R.r0) + (yy + zz), entry(R.r0, R.r1) - h.x * p.y, entry(R.r0, R.r2) - h.x * p.z,
               entry(R.r1, R.r1) + (xx + zz), entry(R.r1, R.r2) - h.y * p.z, entry(R.r2, R.r2) + (xx + yy)});
  }

  /// v, c = v x S qdot and v x* I v of a batch. False where a link is too fast.
  static bool update_velocity(const LaneTree& tree, Batches& b) {
    Frames scratch;
    const V6<V> from = load6(parent(tree, b, scratch).v);
    const double* u = tree.u + b.u;
    V6<V> sum;
    if (single(b)) {
      sum = load(u) * load6(b.S);
    } else {
      const Joints3& joint = joint3(tree, b);
      sum = load(u) * load6(joint.S[0]);
      for (int k = 1; k < rate_count(b.kind); ++k) sum = sum + load(u + k * W) * load6(joint.S[k]);
    }
    // A free body has the world for its parent, and O moves with it.
    const bool free = b.kind == NodeKind::free;
    const V6<V> v = free ? sum : from + sum;
    const V zero = 0.0;
    const V6<V> c = free ? V6<V>{{zero, zero, zero}, cross(v.f, v.n)}
                         : V6<V>{cross(v.n, sum.n), cross(v.n, sum.f) + cross(v.f, sum.n)};
    store6(b.frame.v, v);
    store6(b.c, c);
    if (b.massless) return true;
    const V mass = load(b.mass);
    const V3<V> p = load3(b.frame.p), h = load3(b.h);
    const V3<V> v_C = v.f + cross(v.n, p);
    const V3<V> force = mass * cross(v.n, v_C);
    // Momentum about O, L = I w + h x v; n = w x L + v x m v_C.
    const V3<V> momentum = load_sym(b.I) * v.n + cross(h, v.f);
    const V3<V> torque = cross(v.n, momentum) + mass * cross(v.f, v_C);
    store6(b.pv, {torque, force});
    const V limit = tree.max_speed * tree.max_speed, turn_limit = tree.max_turn * tree.max_turn;
    const V spin = dot(v.n, v.n);
    store(b.spin, spin);
    const V most = load(tree.spin);
    store(tree.spin, articulated::select(spin > most, spin, most));
    const auto bad = !(dot(v_C, v_C) <= limit) || !(spin <= turn_limit);
    return !any(bad);
  }

  static bool kinematics(const LaneTree& tree) {
    bool sound = true;
    store(tree.spin, V(0.0));
    for (int i = 0; i < tree.batches; ++i) turn(tree, batches(tree)[i]);
    for (int i = 0; i < tree.batches; ++i) {
      Batches& b = batches(tree)[i];
      place(tree, b);
      sound = update_velocity(tree, b) && sound;
    }
    return sound;
  }

  static bool velocities(const LaneTree& tree) {
    bool sound = true;
    store(tree.spin, V(0.0));
    for (int i = 0; i < tree.batches; ++i) sound = update_velocity(tree, batches(tree)[i]) && sound;
    return sound;
  }

  /// With the bits of Eigen's product and norm of quaternions.
  static void bodies(const LaneTree& tree) {
    Work<W>* const works = thread_work<W>(static_cast<std::size_t>(tree.batches));
    for (int i = 0; i < tree.batches; ++i) {
      const Batches& b = batches(tree)[i];
      if (b.massless) continue;
      const Q4<V> a = load4(b.frame.quat), c = load4(b.body_turn);
      const Q4<V> q = {(a.w * c.x + a.y * c.z) - (a.z * c.y - a.x * c.w),
                       (a.w * c.y + a.y * c.w) + (a.z * c.x - a.x * c.z),
                       (a.w * c.z - a.y * c.x) + (a.z * c.w + a.x * c.y),
                       (a.w * c.w - a.y * c.y) - (a.z * c.z + a.x * c.x)};
      const V length = square_root(V((q.x * q.x + q.z * q.z) + (q.y * q.y + q.w * q.w)));
      store4(works[i].A, {q.x / length, q.y / length, q.z / length, q.w / length});
      const V6<V> v = load6(b.frame.v);
      store3(works[i].p, v.f + cross(v.n, load3(b.frame.p)));
    }
  }

  static void momenta(const LaneTree& tree) {
    for (int i = 0; i < tree.batches; ++i) {
      Batches& b = batches(tree)[i];
      if (b.massless) continue;
      const V6<V> v = load6(b.frame.v), L = times_rigid(b, load_sym(b.I), v);
      store6(b.momentum, L);
      store(b.energy, 0.5 * dot(L, v));
    }
  }

  static void move(const LaneTree& tree, const Batches& b, double step) {
    const V h = step;
    double *u = tree.u + b.u, *q = tree.q + b.q;
    if (single(b)) {
      const V rate = load(u) + h * load(tree.du + b.u), place = load(q) + h * rate;
      store(u, rate);
      return store(q, b.kind == NodeKind::revolute ? wrapped(place) : place);
    }
    for (int k = 0; k < rate_count(b.kind); ++k)
      store(u + k * W, load(u + k * W) + h * load(tree.du + b.u + k * W));
    if (b.kind == NodeKind::free) {
      for (int k = 0; k < 3; ++k) store(q + k * W, load(q + k * W) + h * load(u + (3 + k) * W));
      q += 3 * W;
    }
    rotate(q, {load(u), load(u + W), load(u + 2 * W)}, h);
  }

  static void integrate(const LaneTree& tree, double step) {
    for (int i = 0; i < tree.batches; ++i) move(tree, batches(tree)[i], step);
  }

  /// compute_torque, move and turn.
  [[gnu::always_inline]] static void advance_single(const LaneTree& tree, Batches& b, double step) {
    const V h = step;
    double *u = tree.u + b.u, *q = tree.q + b.q;
    const V rate = load(u) + h * load(tree.du + b.u), moved = h * rate, place = load(q) + moved;
    Forces<V>::store_torque(tree, b, place, rate, moved);
    store(u, rate);
    if (b.kind == NodeKind::prismatic) return store(q, place);
    const V angle = wrapped(place);
    store(q, angle);
    turn_by(angle, b);
  }

  static bool advance(const LaneTree& tree, double step) {
    bool sound = true;
    store(tree.spin, V(0.0));
    for (int i = 0; i < tree.batches; ++i) {
      Batches& b = batches(tree)[i];
      if (single(b))
        advance_single(tree, b, step);
      else
        move(tree, b, step);
    }
    for (int i = 0; i < tree.batches; ++i) {
      Batches& b = batches(tree)[i];
      place(tree, b);
      sound = update_velocity(tree, b) && sound;
    }
    return sound;
  }

  static V wrapped(const V& angle) {
    return angle - 6.28318530717958647693 * rounded(V(angle * 0.159154943091895335769));
  }

  /// q = rotation by w h, times q: exact for a constant w.
  static void rotate(double* q, const V3<V>& w, const V& h) {
    const V speed = square_root(dot(w, w));
    V s, c;
    sine_cosine(V(speed * h * 0.5), s, c);
    // sin(x)/x near zero.
    const V tiny = 1e-12;
    const V share = articulated::select(speed > tiny, V(s / (speed + 1e-300)), V(h * 0.5));
    const Q4<V> now = Q4<V>{share * w.x, share * w.y, share * w.z, c} *
                      Q4<V>{load(q), load(q + W), load(q + 2 * W), load(q + 3 * W)};
    const Q4<V> out = unit(now);
    store(q, out.x);
    store(q + W, out.y);
    store(q + 2 * W, out.z);
    store(q + 3 * W, out.w);
  }

  static void position_rates(const LaneTree& tree, double* out) {
    for (int i = 0; i < tree.batches; ++i) {
      const Batches& b = batches(tree)[i];
      const double *u = tree.u + b.u, *q = tree.q + b.q;
      double* to = out + b.q;
      if (single(b)) {
        store_loose(to, load(u));
        continue;
      }
      if (b.kind == NodeKind::free) {
        for (int k = 0; k < 3; ++k) store_loose(to + k * W, load(u + (3 + k) * W));
        to += 3 * W;
        q += 3 * W;
      }
      // q' = (w, 0) q / 2 with w in the parent's axes.
      const Q4<V> half = {load(u) * 0.5, load(u + W) * 0.5, load(u + 2 * W) * 0.5, V(0.0)};
      const Q4<V> rate = half * Q4<V>{load(q), load(q + W), load(q + 2 * W), load(q + 3 * W)};
      store_loose(to, rate.x);
      store_loose(to + W, rate.y);
      store_loose(to + 2 * W, rate.z);
      store_loose(to + 3 * W, rate.w);
    }
  }

  static void normalise(const LaneTree& tree) {
    for (int i = 0; i < tree.batches; ++i) {
      const Batches& b = batches(tree)[i];
      double* q = tree.q + b.q;
      if (b.kind == NodeKind::revolute) store(q, wrapped(load(q)));
      if (single(b)) continue;
      if (b.kind == NodeKind::free) q += 3 * W;
      const Q4<V> out = unit({load(q), load(q + W), load(q + 2 * W), load(q + 3 * W)});
      store(q, out.x);
      store(q + W, out.y);
      store(q + 2 * W, out.z);
      store(q + 3 * W, out.w);
    }
  }
};

}  // namespace handsim::engine::articulated
