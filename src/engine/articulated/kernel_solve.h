// Of kernel.h: the articulated-body algorithm (Featherstone 2008, section 7.3, Table 7.1, p. 132).
#pragma once

#include "handsim/engine/articulated/kernel.h"

namespace handsim::engine::articulated {

template <class V>
inline Inertia<V> Lanes<V>::inertia(const Batches& b, const Work<W>& w) {
  if (b.massless) return {load_sym(w.A), load_mat(w.B), load_sym(w.C)};
  const V mass = load(b.mass), zero = 0.0;
  const V3<V> h = load3(b.h);
  Inertia<V> out = {load_sym(b.I),
                    {{zero, zero - h.z, h.y}, {h.z, zero, zero - h.x}, {zero - h.y, h.x, zero}},
                    {mass, zero, zero, mass, zero, mass}};
  if (!b.has_children) return out;
  const Mat<V> B = load_mat(w.B);
  return {out.A + load_sym(w.A), {out.B.r0 + B.r0, out.B.r1 + B.r1, out.B.r2 + B.r2}, out.C + load_sym(w.C)};
}

template <class V>
inline V6<V> Lanes<V>::bias(const Batches& b, const Work<W>& w) {
  if (b.massless) return load6(w.p);
  const V6<V> own = load6(b.pv);
  return b.has_children ? own + load6(w.p) : own;
}

/// Adds what a batch hands down to its parents.
template <class V>
[[gnu::always_inline]] inline void Lanes<V>::add_to_parent(const Batches& b, Works works, const Inertia<V>& I,
                                                           const V6<V>& p) {
  if (b.link == ParentLink::aligned) {
    Work<W>& to = works[b.parent];
    if (b.adds_first) {
      // A sum with zero has no negative zeros.
      const V zero = 0.0;
      const V3<V> none = {zero, zero, zero};
      store_sym(to.A, I.A + Sym3<V>{zero, zero, zero, zero, zero, zero});
      store_mat(to.B, {I.B.r0 + none, I.B.r1 + none, I.B.r2 + none});
      store_sym(to.C, I.C + Sym3<V>{zero, zero, zero, zero, zero, zero});
      store6(to.p, p + V6<V>{none, none});
      return;
    }
    store_sym(to.A, load_sym(to.A) + I.A);
    const Mat<V> B = load_mat(to.B);
    store_mat(to.B, {B.r0 + I.B.r0, B.r1 + I.B.r1, B.r2 + I.B.r2});
    store_sym(to.C, load_sym(to.C) + I.C);
    store6(to.p, load6(to.p) + p);
    return;
  }
  alignas(64) Lane<W> sum[kArticulated];
  store_sym(sum, I.A);
  store_mat(sum + 6, I.B);
  store_sym(sum + 15, I.C);
  store6(sum + 21, p);
  for (int lane = b.used - 1; lane >= 0; --lane) {
    double* to = &works[b.parent_batch[lane]].A[0][0] + b.parent_lane[lane];
    for (int i = 0; i < kArticulated; ++i) to[i * W] += sum[i][lane];
  }
}

template <class V>
inline void Lanes<V>::inward_any(const Tree& tree, Works works, int batch) {
  Batches& b = batches(tree)[batch];
  if (single(b))
    inward(tree, b, works, works[batch]);
  else if (b.kind == NodeKind::ball)
    inward_many<3>(tree, b, works, works[batch]);
  else
    inward_many<6>(tree, b, works, works[batch]);
}

template <class V>
inline void Lanes<V>::outward_any(const Tree& tree, Works works, int batch) {
  Batches& b = batches(tree)[batch];
  if (single(b))
    outward(tree, b, works[batch]);
  else if (b.kind == NodeKind::ball)
    outward_many<3>(tree, b);
  else
    outward_many<6>(tree, b);
}

template <class V>
inline void Lanes<V>::solve(const Tree& tree) {
  const Works works = cleared(tree);
  for (int i = tree.batches - 1; i >= 0; --i) inward_any(tree, works, i);
  for (int i = 0; i < tree.batches; ++i) outward_any(tree, works, i);
}

template <class V>
inline bool Lanes<V>::accelerate(const Tree& tree, double step) {
  const Works works = cleared(tree);
  for (int i = tree.batches - 1; i >= 0; --i) {
    const Batches& b = batches(tree)[i];
    if (single(b)) prepare_axis(tree, b, step);
    inward_any(tree, works, i);
  }
  bool sound = true;
  for (int i = 0; i < tree.batches; ++i) {
    const Batches& b = batches(tree)[i];
    outward_any(tree, works, i);
    if (single(b)) sound = correct(tree, b, step, false) && sound;
  }
  return sound;
}

template <class V>
inline typename Lanes<V>::Works Lanes<V>::cleared(const Tree& tree) {
  const auto works = static_cast<Works>(
      thread_work(WorkOf::batches, sizeof(Work<W>) * static_cast<std::size_t>(tree.batches)));
  const V zero = 0.0;
  for (int i = 0; i < tree.batches; ++i)
    for (int k = 0; k < kArticulated && batches(tree)[i].cleared; ++k) store(&works[i].A[0][0] + k * W, zero);
  return works;
}

/// The same as by the 6 x 6 blocks, to the bit, without their zeros.
template <class V>
inline V6<V> Lanes<V>::times_rigid(const Batches& b, const Sym3<V>& I, const V6<V>& S) {
  const V3<V> h = load3(b.h);
  return {I * S.n + cross(h, S.f), cross(S.n, h) + load(b.mass) * S.f};
}

template <class V>
inline void Lanes<V>::inward(const Tree& tree, Batches& b, Works works, Work<W>& w) {
  const Axes& a = axis(tree, b);
  const Inertia<V> I = inertia(b, w);
  const V6<V> S = load6(b.S), p = bias(b, w);
  const V6<V> U = b.has_children ? I * S : times_rigid(b, I.A, S);
  const V D = dot(S, U), locked = load(a.locked), weighted = D + load(a.weight);
  // A locked coordinate hands its whole inertia down and takes the acceleration it is given.
  const V inverse = (V(1.0) - locked) / weighted;
  const V u = load(a.force) - dot(S, p);
  const V rate = inverse * u + locked * load(a.given);
  store6(w.U, U);
  store(w.weighted, weighted);
  store(w.inverse, inverse);
  store(w.u_force, u);
  store(w.rate, rate);
  if (b.link == ParentLink::base) return;
  const Inertia<V> handed = {less(I.A, inverse, U.n), less(I.B, inverse, U.n, U.f), less(I.C, inverse, U.f)};
  const V6<V> c = load6(b.c);
  add_to_parent(b, works, handed, p + handed * c + rate * U);
}

template <class V>
inline void Lanes<V>::outward(const Tree& tree, Batches& b, const Work<W>& w) {
  Frames scratch;
  const V6<V> a = load6(parent(tree, b, scratch).a) + load6(b.c);
  const V carried = dot(load6(w.U), a);
  const V rate = load(w.rate) - load(w.inverse) * carried;
  store(tree.du + b.u, rate);
  // What the law of motion lacks is the lock's force.
  store(axis(tree, b).reaction, load(w.weighted) * rate + carried - load(w.u_force));
  store6(b.frame.a, a + rate * load6(b.S));
}

/// D = L L^T in place, lower triangle, its diagonal inverted.
template <class V>
template <int N>
inline void Lanes<V>::factor(Lane<W> (*D)[6]) {
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
template <class V>
template <int N>
inline void Lanes<V>::solve_factored(const Lane<W> (*D)[6], V (&x)[N]) {
  for (int i = 0; i < N; ++i) {
    for (int k = 0; k < i; ++k) x[i] = x[i] - load(D[i][k]) * x[k];
    x[i] = x[i] * load(D[i][i]);
  }
  for (int i = N - 1; i >= 0; --i) {
    for (int k = i + 1; k < N; ++k) x[i] = x[i] - load(D[k][i]) * x[k];
    x[i] = x[i] * load(D[i][i]);
  }
}

template <class V>
template <int N>
inline void Lanes<V>::inward_many(const Tree& tree, Batches& b, Works works, const Work<W>& w) {
  const Joints3& joint = joint3(tree, b);
  Work3<W>& w3 = work3(b);
  Inertia<V> I = inertia(b, w);
  V6<V> p = bias(b, w);
  V u[N];
  for (int j = 0; j < N; ++j) {
    const V6<V> S = load6(joint.S[j]), U = I * S;
    store6(w3.U[j], U);
    for (int i = 0; i <= j; ++i) store(w3.D[j][i], dot(load6(joint.S[i]), U));
    u[j] = load(joint.tau[j]) - dot(S, p);
  }
  factor<N>(w3.D);
  solve_factored<N>(w3.D, u);
  for (int j = 0; j < N; ++j) store(w3.rate[j], u[j]);
  if (b.link == ParentLink::base) return;
  // L^-1 U^T, row by row: U D^-1 U^T is the sum of its squares.
  V6<V> half[N];
  for (int j = 0; j < N; ++j) {
    half[j] = load6(w3.U[j]);
    p = p + u[j] * half[j];
    for (int k = 0; k < j; ++k) half[j] = half[j] + V(-load(w3.D[j][k])) * half[k];
    half[j] = load(w3.D[j][j]) * half[j];
    const V one = 1.0;
    I = {less(I.A, one, half[j].n), less(I.B, one, half[j].n, half[j].f), less(I.C, one, half[j].f)};
  }
  add_to_parent(b, works, I, p + I * load6(b.c));
}

template <class V>
template <int N>
inline void Lanes<V>::outward_many(const Tree& tree, Batches& b) {
  const Joints3& joint = joint3(tree, b);
  const Work3<W>& w3 = work3(b);
  Frames scratch;
  V6<V> a = load6(parent(tree, b, scratch).a) + load6(b.c);
  V x[N];
  for (int j = 0; j < N; ++j) x[j] = dot(load6(w3.U[j]), a);
  solve_factored<N>(w3.D, x);
  for (int j = 0; j < N; ++j) {
    x[j] = load(w3.rate[j]) - x[j];
    store(tree.du + b.u + j * W, x[j]);
    a = a + x[j] * load6(joint.S[j]);
  }
  store6(b.frame.a, a);
}

}  // namespace handsim::engine::articulated
