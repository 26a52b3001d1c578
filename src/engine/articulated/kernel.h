// The recursive algorithms in lanes: written once for any number type V, built for each instruction set in a
// file of its own. Notation of Featherstone 2008; body-fixed steps in world axes about O, so that X is the
// identity. Included by the kernel_*.cpp files only.
#pragma once

#include "handsim/engine/articulated/batch.h"
#include "handsim/engine/articulated/spatial.h"

namespace handsim::engine::articulated {

template <class V>
struct Lanes {
  static constexpr int kWidth = [] {
    if constexpr (std::is_same_v<V, double>)
      return 1;
    else
      return static_cast<int>(V::size());
  }();
  static constexpr int W = kWidth;
  using Batches = Batch<W>;
  using Axes = Axis<W>;
  using Joints3 = Joint3<W>;
  using Frames = Frame<W>;

  static V load(const double* x) {
    if constexpr (std::is_same_v<V, double>)
      return *x;
    else
      return V(x, stdx::vector_aligned);
  }
  static void store(double* x, const V& v) {
    if constexpr (std::is_same_v<V, double>)
      *x = v;
    else
      v.copy_to(x, stdx::vector_aligned);
  }
  /// Where nothing is known of the alignment.
  static void store_loose(double* x, const V& v) {
    if constexpr (std::is_same_v<V, double>)
      *x = v;
    else
      v.copy_to(x, stdx::element_aligned);
  }
  static V3<V> load3(const Lane<W>* x) { return {load(x[0]), load(x[1]), load(x[2])}; }
  static V6<V> load6(const Lane<W>* x) { return {load3(x), load3(x + 3)}; }
  static Q4<V> load4(const Lane<W>* x) { return {load(x[0]), load(x[1]), load(x[2]), load(x[3])}; }
  static Sym3<V> load_sym(const Lane<W>* x) {
    return {load(x[0]), load(x[1]), load(x[2]), load(x[3]), load(x[4]), load(x[5])};
  }
  static Mat<V> load_mat(const Lane<W>* x) { return {load3(x), load3(x + 3), load3(x + 6)}; }
  static void store3(Lane<W>* x, const V3<V>& v) {
    store(x[0], v.x);
    store(x[1], v.y);
    store(x[2], v.z);
  }
  static void store6(Lane<W>* x, const V6<V>& v) {
    store3(x, v.n);
    store3(x + 3, v.f);
  }
  static void store4(Lane<W>* x, const Q4<V>& v) {
    store(x[0], v.x);
    store(x[1], v.y);
    store(x[2], v.z);
    store(x[3], v.w);
  }
  static void store_sym(Lane<W>* x, const Sym3<V>& v) {
    store3(x, {v.xx, v.xy, v.xz});
    store3(x + 3, {v.yy, v.yz, v.zz});
  }
  static void store_mat(Lane<W>* x, const Mat<V>& v) {
    store3(x, v.r0);
    store3(x + 3, v.r1);
    store3(x + 6, v.r2);
  }
  static void add(double* x, const V& v) { store(x, load(x) + v); }

  static Batches* batches(const Tree& tree) { return static_cast<Batches*>(tree.batch); }
  static Axes& axis(const Tree& tree, const Batches& b) { return static_cast<Axes*>(tree.axis)[b.axis]; }
  static Joints3& joint3(const Tree& tree, const Batches& b) {
    return static_cast<Joints3*>(tree.joint3)[b.axis];
  }
  static bool single(const Batches& b) {
    return b.kind == NodeKind::revolute || b.kind == NodeKind::prismatic;
  }

  /// The parents' frame; `scratch` is filled where each lane has its own.
  static const Frames& parent(const Tree& tree, const Batches& b, Frames& scratch) {
    if (b.link == ParentLink::base) return static_cast<Frames*>(tree.base)[b.parent];
    if (b.link == ParentLink::aligned) return batches(tree)[b.parent].frame;
    gather(tree, b, scratch);
    return scratch;
  }
  static void gather(const Tree& tree, const Batches& b, Frames& scratch) {
    constexpr int kNumbers = static_cast<int>(sizeof(Frames) / sizeof(Lane<W>));
    double* out = &scratch.quat[0][0];
    for (int lane = 0; lane < W; ++lane) {
      const double* in = &batches(tree)[b.parent_batch[lane]].frame.quat[0][0] + b.parent_lane[lane];
      for (int i = 0; i < kNumbers; ++i) out[i * W + lane] = in[i * W];
    }
  }

  // Positions ---------------------------------------------------------------------------------------------

  static void place(const Tree& tree, Batches& b) {
    Frames scratch;
    const Frames& from = parent(tree, b, scratch);
    const double* q = tree.q + b.q;
    Q4<V> quat;
    V3<V> p;
    switch (b.kind) {
      case NodeKind::revolute: {
        V s, c;
        sine_cosine(V(load(q) * 0.5), s, c);
        const Q4<V> k = load4(b.before), t = load4(b.turned);
        quat = load4(from.quat) *
               Q4<V>{c * k.x + s * t.x, c * k.y + s * t.y, c * k.z + s * t.z, c * k.w + s * t.w};
        const V3<V> o = load3(from.p) + load_mat(from.R) * load3(b.anchor);
        const Mat<V> R = rotation(quat);
        const V3<V> axis = R * load3(b.direction);
        p = o + R * load3(b.arm);
        store6(b.S, {axis, cross(o, axis)});
        return settle(b, quat, R, p);
      }
      case NodeKind::prismatic: {
        quat = load4(from.quat) * load4(b.before);
        const Mat<V> R_from = load_mat(from.R), R = rotation(quat);
        const V3<V> axis = R_from * load3(b.direction);
        p = load3(from.p) + R_from * load3(b.anchor) + load(q) * axis + R * load3(b.arm);
        const V zero = 0.0;
        store6(b.S, {{zero, zero, zero}, axis});
        return settle(b, quat, R, p);
      }
      case NodeKind::ball: {
        const Q4<V> q_WF = load4(from.quat) * load4(b.before);
        quat = q_WF * unit({load(q), load(q + W), load(q + 2 * W), load(q + 3 * W)}) *
               load4(joint3(tree, b).after);
        const V3<V> o = load3(from.p) + load_mat(from.R) * load3(b.anchor);
        const Mat<V> R = rotation(quat), R_F = rotation(q_WF);
        p = o + R * load3(b.arm);
        Joints3& joint = joint3(tree, b);
        const V3<V> axes[3] = {
            {R_F.r0.x, R_F.r1.x, R_F.r2.x}, {R_F.r0.y, R_F.r1.y, R_F.r2.y}, {R_F.r0.z, R_F.r1.z, R_F.r2.z}};
        for (int k = 0; k < 3; ++k) store6(joint.S[k], {axes[k], cross(o, axes[k])});
        return settle(b, quat, R, p);
      }
      case NodeKind::free: {
        // O is where the body is.
        quat = unit({load(q + 3 * W), load(q + 4 * W), load(q + 5 * W), load(q + 6 * W)});
        const V zero = 0.0;
        for (int k = 0; k < 6; ++k)
          for (int i = 0; i < 6; ++i) store(joint3(tree, b).S[k][i], V(i == k ? 1.0 : 0.0));
        return settle(b, quat, rotation(quat), {zero, zero, zero});
      }
    }
  }

  static Q4<V> unit(const Q4<V>& q) {
    const V scale = V(1.0) / square_root(V(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w));
    return {scale * q.x, scale * q.y, scale * q.z, scale * q.w};
  }

  /// Pose and inertia of the link: I_O = sum over principal axes e of I_e e e^T + m (p.p 1 - p p^T).
  static void settle(Batches& b, const Q4<V>& quat, const Mat<V>& R, const V3<V>& p) {
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

  // Velocities --------------------------------------------------------------------------------------------

  /// v, c = v x S qdot and v x* I v of a batch. False where a link is too fast.
  static bool move(const Tree& tree, Batches& b) {
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
    const V limit = tree.max_speed * tree.max_speed, turn = tree.max_turn * tree.max_turn;
    const auto bad = !(dot(v_C, v_C) <= limit) || !(dot(v.n, v.n) <= turn);
    return !any(bad);
  }

  static bool kinematics(const Tree& tree) {
    bool sound = true;
    for (int i = 0; i < tree.batches; ++i) {
      Batches& b = batches(tree)[i];
      place(tree, b);
      sound = move(tree, b) && sound;
    }
    return sound;
  }
  static bool velocities(const Tree& tree) {
    bool sound = true;
    for (int i = 0; i < tree.batches; ++i) sound = move(tree, batches(tree)[i]) && sound;
    return sound;
  }

  // Forces ------------------------------------------------------------------------------------------------

  /// A spring-damper evaluated at the end of the step, F = F0 - k h u' - d u' with u' = u + h du, is
  /// F0 - (h k + d) u on the right and h (h k + d) on the joint-space inertia's diagonal.
  static void prepare(const Tree& tree, double step) {
    const V h = step;
    for (int i = 0; i < tree.batches; ++i) {
      const Batches& b = batches(tree)[i];
      if (!single(b)) continue;
      Axes& a = axis(tree, b);
      const V q = load(tree.q + b.q), u = load(tree.u + b.u);
      const V k = load(a.stiffness);
      const V soft = h * k + load(a.damping);
      const V ks = load(a.servo_stiffness);
      const V servo = h * ks + load(a.servo_damping);
      const V saturated = load(a.saturated);
      const V on = V(1.0) - saturated * saturated;
      const V pull = ks * load(a.servo_error) + load(a.servo_feed) - servo * u;
      store(a.force,
            load(a.tau) - k * (q - load(a.rest)) - soft * u + on * pull + saturated * load(a.servo_limit));
      // An empty lane has to have some inertia.
      store(a.weight, h * (soft + on * servo) + (V(1.0) - load(a.present)));
      aim(tree, b, a, step);
    }
  }

  static void prepare_smooth(const Tree& tree) {
    const V zero = 0.0;
    for (int i = 0; i < tree.batches; ++i) {
      const Batches& b = batches(tree)[i];
      if (!single(b)) continue;
      Axes& a = axis(tree, b);
      const V q = load(tree.q + b.q), u = load(tree.u + b.u);
      const V limit = load(a.servo_limit);
      V pull = load(a.servo_stiffness) * (load(a.servo_error) - q) - load(a.servo_damping) * u +
               load(a.servo_feed);
      pull = articulated::select(pull > limit, limit, pull);
      pull = articulated::select(pull < V(zero - limit), V(zero - limit), pull);
      store(a.force, load(a.tau) - load(a.stiffness) * (q - load(a.rest)) - load(a.damping) * u + pull);
      store(a.weight, V(1.0) - load(a.present));
      store(a.locked, V(1.0) - load(a.present));
      store(a.given, zero);
    }
  }

  // Articulated-body algorithm (Featherstone 2008, section 7.3, Table 7.1, p. 132)
  // -----------------------------

  static Inertia<V> inertia(const Batches& b) {
    if (b.massless) return {load_sym(b.A), load_mat(b.B), load_sym(b.C)};
    const V mass = load(b.mass), zero = 0.0;
    const V3<V> h = load3(b.h);
    Inertia<V> out = {load_sym(b.I),
                      {{zero, zero - h.z, h.y}, {h.z, zero, zero - h.x}, {zero - h.y, h.x, zero}},
                      {mass, zero, zero, mass, zero, mass}};
    if (!b.has_children) return out;
    const Mat<V> B = load_mat(b.B);
    return {
        out.A + load_sym(b.A), {out.B.r0 + B.r0, out.B.r1 + B.r1, out.B.r2 + B.r2}, out.C + load_sym(b.C)};
  }
  static V6<V> bias(const Batches& b) {
    if (b.massless) return load6(b.p);
    const V6<V> own = load6(b.pv);
    return b.has_children ? own + load6(b.p) : own;
  }

  static constexpr int kHanded = 27;  ///< numbers of A, B, C, p

  /// Adds what a batch hands down to its parents.
  static void hand_down(const Tree& tree, const Batches& b, const Inertia<V>& I, const V6<V>& p) {
    if (b.link == ParentLink::aligned) {
      Batches& to = batches(tree)[b.parent];
      store_sym(to.A, load_sym(to.A) + I.A);
      const Mat<V> B = load_mat(to.B);
      store_mat(to.B, {B.r0 + I.B.r0, B.r1 + I.B.r1, B.r2 + I.B.r2});
      store_sym(to.C, load_sym(to.C) + I.C);
      store6(to.p, load6(to.p) + p);
      return;
    }
    alignas(64) Lane<W> sum[kHanded];
    store_sym(sum, I.A);
    store_mat(sum + 6, I.B);
    store_sym(sum + 15, I.C);
    store6(sum + 21, p);
    for (int lane = b.used - 1; lane >= 0; --lane) {
      double* to = &batches(tree)[b.parent_batch[lane]].A[0][0] + b.parent_lane[lane];
      for (int i = 0; i < kHanded; ++i) to[i * W] += sum[i][lane];
    }
  }

  static void solve(const Tree& tree) {
    for (int i = 0; i < tree.batches; ++i) clear(batches(tree)[i]);
    for (int i = tree.batches - 1; i >= 0; --i) {
      Batches& b = batches(tree)[i];
      if (single(b))
        inward(tree, b);
      else if (b.kind == NodeKind::ball)
        inward_many<3>(tree, b);
      else
        inward_many<6>(tree, b);
    }
    for (int i = 0; i < tree.batches; ++i) {
      Batches& b = batches(tree)[i];
      if (single(b))
        outward(tree, b);
      else if (b.kind == NodeKind::ball)
        outward_many<3>(tree, b);
      else
        outward_many<6>(tree, b);
    }
  }

  static void clear(Batches& b) {
    if (!b.has_children) return;
    const V zero = 0.0;
    for (int i = 0; i < kHanded; ++i) store(&b.A[0][0] + i * W, zero);
  }

  /// The same as by the 6 x 6 blocks, to the bit, without their zeros.
  static V6<V> times_rigid(const Batches& b, const Sym3<V>& I, const V6<V>& S) {
    const V3<V> h = load3(b.h);
    return {I * S.n + cross(h, S.f), cross(S.n, h) + load(b.mass) * S.f};
  }

  static void inward(const Tree& tree, Batches& b) {
    const Axes& a = axis(tree, b);
    const Inertia<V> I = inertia(b);
    const V6<V> S = load6(b.S), p = bias(b);
    const V6<V> U = b.has_children ? I * S : times_rigid(b, I.A, S);
    const V D = dot(S, U), locked = load(a.locked), weighted = D + load(a.weight);
    // A locked coordinate hands its whole inertia down and takes the acceleration it is given.
    const V inverse = (V(1.0) - locked) / weighted;
    const V u = load(a.force) - dot(S, p);
    const V rate = inverse * u + locked * load(a.given);
    store6(b.U, U);
    store(b.weighted, weighted);
    store(b.inverse, inverse);
    store(b.u_force, u);
    store(b.rate, rate);
    if (b.link == ParentLink::base) return;
    const Inertia<V> handed = {less(I.A, inverse, U.n), less(I.B, inverse, U.n, U.f),
                               less(I.C, inverse, U.f)};
    const V6<V> c = load6(b.c);
    hand_down(tree, b, handed, p + handed * c + rate * U);
  }

  static void outward(const Tree& tree, Batches& b) {
    Frames scratch;
    const V6<V> a = load6(parent(tree, b, scratch).a) + load6(b.c);
    const V carried = dot(load6(b.U), a);
    const V rate = load(b.rate) - load(b.inverse) * carried;
    store(tree.du + b.u, rate);
    // What the law of motion lacks is the lock's force.
    store(axis(tree, b).reaction, load(b.weighted) * rate + carried - load(b.u_force));
    store6(b.frame.a, a + rate * load6(b.S));
  }

  /// D = L L^T in place, lower triangle, its diagonal inverted.
  template <int N>
  static void factor(Lane<W> (*D)[6]) {
    for (int j = 0; j < N; ++j) {
      V sum = load(D[j][j]);
      for (int k = 0; k < j; ++k) sum = sum - load(D[j][k]) * load(D[j][k]);
      const V inverse = V(1.0) / square_root(sum);
      store(D[j][j], inverse);
      for (int i = j + 1; i < N; ++i) {
        V s = load(D[i][j]);
        for (int k = 0; k < j; ++k) s = s - load(D[i][k]) * load(D[j][k]);
        store(D[i][j], s * inverse);
      }
    }
  }
  /// x = D^-1 x by its factor.
  template <int N>
  static void solve_factored(const Lane<W> (*D)[6], V (&x)[N]) {
    for (int i = 0; i < N; ++i) {
      for (int k = 0; k < i; ++k) x[i] = x[i] - load(D[i][k]) * x[k];
      x[i] = x[i] * load(D[i][i]);
    }
    for (int i = N - 1; i >= 0; --i) {
      for (int k = i + 1; k < N; ++k) x[i] = x[i] - load(D[k][i]) * x[k];
      x[i] = x[i] * load(D[i][i]);
    }
  }

  template <int N>
  static void inward_many(const Tree& tree, Batches& b) {
    Joints3& joint = joint3(tree, b);
    Inertia<V> I = inertia(b);
    V6<V> p = bias(b);
    V u[N];
    for (int j = 0; j < N; ++j) {
      const V6<V> S = load6(joint.S[j]), U = I * S;
      store6(joint.U[j], U);
      for (int i = 0; i <= j; ++i) store(joint.D[j][i], dot(load6(joint.S[i]), U));
      u[j] = load(joint.tau[j]) - dot(S, p);
    }
    factor<N>(joint.D);
    solve_factored<N>(joint.D, u);
    for (int j = 0; j < N; ++j) store(joint.rate[j], u[j]);
    if (b.link == ParentLink::base) return;
    // L^-1 U^T, row by row: U D^-1 U^T is the sum of its squares.
    V6<V> half[N];
    for (int j = 0; j < N; ++j) {
      half[j] = load6(joint.U[j]);
      p = p + u[j] * half[j];
      for (int k = 0; k < j; ++k) half[j] = half[j] + V(-load(joint.D[j][k])) * half[k];
      half[j] = load(joint.D[j][j]) * half[j];
      const V one = 1.0;
      I = {less(I.A, one, half[j].n), less(I.B, one, half[j].n, half[j].f), less(I.C, one, half[j].f)};
    }
    hand_down(tree, b, I, p + I * load6(b.c));
  }

  template <int N>
  static void outward_many(const Tree& tree, Batches& b) {
    const Joints3& joint = joint3(tree, b);
    Frames scratch;
    V6<V> a = load6(parent(tree, b, scratch).a) + load6(b.c);
    V x[N];
    for (int j = 0; j < N; ++j) x[j] = dot(load6(joint.U[j]), a);
    solve_factored<N>(joint.D, x);
    for (int j = 0; j < N; ++j) {
      x[j] = load(joint.rate[j]) - x[j];
      store(tree.du + b.u + j * W, x[j]);
      a = a + x[j] * load6(joint.S[j]);
    }
    store6(b.frame.a, a);
  }

  // Stops and torque limits ---------------------------------------------------------------------------------

  static bool revise(const Tree& tree, double step, bool only_first) {
    const V h = step, one = 1.0, zero = 0.0;
    const V tight = 1.0 - 1e-9, loose = 1.0 + 1e-9, touch = 1e-12;
    bool sound = true;
    for (int i = 0; i < tree.batches; ++i) {
      const Batches& b = batches(tree)[i];
      if (!single(b)) continue;
      Axes& a = axis(tree, b);
      const V q = load(tree.q + b.q), u = load(tree.u + b.u), u1 = u + h * load(tree.du + b.u);
      const V ks = load(a.servo_stiffness), limit = load(a.servo_limit), was = load(a.saturated);
      const V pull = ks * (load(a.servo_error) - h * u1) - load(a.servo_damping) * u1 + load(a.servo_feed);
      const V bound = limit * articulated::select(was * was > zero, tight, loose);
      V now = articulated::select(pull > bound, one, zero);
      now = articulated::select(pull < V(zero - bound), V(zero - one), now);
      const V side = load(a.side), low = load(a.low), high = load(a.high);
      const V then = q + h * u1;
      V reached = articulated::select(then < low - touch, V(zero - one), zero);
      reached = articulated::select(then > high + touch, one, reached);
      // A stop pushes inward only: up from the low end, down from the high one.
      const V held = articulated::select(side * load(a.reaction) <= zero, side, zero);
      reached = articulated::select(side * side > zero, held, reached);
      const auto wrong = (now != was) || (reached != side);
      if (!any(wrong)) continue;
      sound = false;
      if (only_first) {
        correct_first(a, now, reached);
        return false;
      }
      store(a.saturated, now);
      store(a.side, reached);
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
  static void aim(const Tree& tree, const Batches& b, Axes& a, double step) {
    const V zero = 0.0, h = step;
    const V side = load(a.side), q = load(tree.q + b.q), u = load(tree.u + b.u);
    const V end = articulated::select(side < zero, load(a.low), load(a.high));
    // Along the way out: how far there is to go, and how fast it goes.
    const V room = articulated::select(side < zero, V(q - end), V(end - q));
    const V speed = side * u;
    V target = articulated::select(room < zero, V(tree.erp * room / h), V(room / h));
    const V bounced = V(zero - load(a.bounce)) * speed;
    target = articulated::select(speed > zero && bounced < target && load(a.bounce) > zero, bounced, target);
    const auto on = side * side > zero;
    store(a.locked, articulated::select(on, V(1.0), V(1.0 - load(a.present))));
    store(a.given, articulated::select(on, V((side * target - u) / h), zero));
  }

  // Integration ---------------------------------------------------------------------------------------------

  static void integrate(const Tree& tree, double step) {
    const V h = step;
    for (int i = 0; i < tree.batches; ++i) {
      const Batches& b = batches(tree)[i];
      double *u = tree.u + b.u, *q = tree.q + b.q;
      for (int k = 0; k < rate_count(b.kind); ++k)
        store(u + k * W, load(u + k * W) + h * load(tree.du + b.u + k * W));
      switch (b.kind) {
        case NodeKind::revolute:
          store(q, wrapped(V(load(q) + h * load(u))));
          break;
        case NodeKind::prismatic:
          store(q, load(q) + h * load(u));
          break;
        case NodeKind::ball:
          turn(q, {load(u), load(u + W), load(u + 2 * W)}, h);
          break;
        case NodeKind::free:
          for (int k = 0; k < 3; ++k) store(q + k * W, load(q + k * W) + h * load(u + (3 + k) * W));
          turn(q + 3 * W, {load(u), load(u + W), load(u + 2 * W)}, h);
          break;
      }
    }
  }

  static V wrapped(const V& angle) {
    return angle - 6.28318530717958647693 * rounded(V(angle * 0.159154943091895335769));
  }

  /// q = rotation by w h, times q: exact for a constant w.
  static void turn(double* q, const V3<V>& w, const V& h) {
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

  static void position_rates(const Tree& tree, double* out) {
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

  static void normalise(const Tree& tree) {
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

  static constexpr Kernel kernel(const char* name) {
    return {name,  W,      kinematics, velocities,     prepare,  prepare_smooth,
            solve, revise, integrate,  position_rates, normalise};
  }
};

}  // namespace handsim::engine::articulated
