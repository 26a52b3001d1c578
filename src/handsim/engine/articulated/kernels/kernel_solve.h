// The articulated-body algorithm (Featherstone 2008, section 7.3, Table 7.1, p. 132).
#pragma once

#include "handsim/engine/articulated/kernels/kernel_forces.h"
#include "handsim/engine/articulated/kernels/lanes.h"

namespace handsim::engine::articulated {

template <class V>
struct ArticulatedBodies : Lanes<V> {
  using L = Lanes<V>;
  using L::W, L::load, L::store, L::store_loose, L::load3, L::load6, L::load_sym, L::load_mat, L::store3,
      L::store6, L::store_sym, L::store_mat, L::batches, L::axis, L::joint3, L::single, L::parent,
      L::times_rigid;
  using typename L::Batches, typename L::Axes, typename L::Joints3, typename L::Frames;

  using Works = Work<W>*;  ///< of each batch of a tree
  /// The first call in a solution has the largest index.
  static Work3<W>& work3(const Batches& b) {
    const auto index = static_cast<std::size_t>(b.axis);
    return thread_work3<W>(index + 1)[index];
  }
  static bool lone(const Batches& b) { return b.kind == NodeKind::free && !b.has_children; }

  [[gnu::always_inline]] static Inertia<V> inertia(const Batches& b, const Work<W>& w) {
    if (b.massless) return {load_sym(w.A), load_mat(w.B), load_sym(w.C)};
    const V mass = load(b.mass), zero = 0.0;
    const V3<V> h = load3(b.h);
    Inertia<V> out = {load_sym(b.I),
                      {{zero, zero - h.z, h.y}, {h.z, zero, zero - h.x}, {zero - h.y, h.x, zero}},
                      {mass, zero, zero, mass, zero, mass}};
    if (!b.has_children) return out;
    const Mat<V> B = load_mat(w.B);
    return {
        out.A + load_sym(w.A), {out.B.r0 + B.r0, out.B.r1 + B.r1, out.B.r2 + B.r2}, out.C + load_sym(w.C)};
  }

  [[gnu::always_inline]] static V6<V> bias(const Batches& b, const Work<W>& w) {
    if (b.massless) return load6(w.p);
    const V6<V> own = load6(b.pv);
    return b.has_children ? own + load6(w.p) : own;
  }

  /// Adds what a batch hands down to its parents.
  [[gnu::always_inline]] static void add_to_parent(const Batches& b, Works works, const Inertia<V>& I,
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
    Handed<W> sum;
    store_sym(sum.A, I.A);
    store_mat(sum.B, I.B);
    store_sym(sum.C, I.C);
    store6(sum.p, p);
    for (int lane = b.used - 1; lane >= 0; --lane) {
      Handed<W>& parent = works[b.parent_batch[lane]];
      const int to_lane = b.parent_lane[lane];
      Handed<W>::each_field([&](auto field) {
        auto& to = parent.*field;
        const auto& from = sum.*field;
        for (std::size_t i = 0; i < std::extent_v<std::remove_reference_t<decltype(to)>>; ++i)
          to[i][to_lane] += from[i][lane];
      });
    }
  }

  static void inward_any(const LaneTree& tree, Works works, int batch) {
    Batches& b = batches(tree)[batch];
    if (single(b))
      inward(tree, b, works, works[batch]);
    else if (b.kind == NodeKind::ball)
      inward_many<3>(tree, b, works, works[batch]);
    else if (lone(b))
      inward_lone(tree, b);
    else
      inward_many<6>(tree, b, works, works[batch]);
  }

  static void outward_any(const LaneTree& tree, Works works, int batch) {
    Batches& b = batches(tree)[batch];
    if (single(b))
      outward(tree, b, works[batch]);
    else if (b.kind == NodeKind::ball)
      outward_many<3>(tree, b);
    else if (lone(b))
      outward_lone(tree, b);
    else
      outward_many<6>(tree, b);
  }

  static void solve(const LaneTree& tree) {
    const Works works = cleared(tree);
    for (int i = tree.batches - 1; i >= 0; --i) inward_any(tree, works, i);
    for (int i = 0; i < tree.batches; ++i) outward_any(tree, works, i);
  }

  /// Products of an inertia, and of spatial vectors. Paired: with the bits of Eigen's, which take two numbers
  /// at a time.
  template <bool kPaired>
  [[gnu::always_inline]] static V3<V> product(const Sym3<V>& I, const V3<V>& a) {
    V3<V> out = I * a;
    if constexpr (kPaired) out.z = I.xz * a.x + (I.yz * a.y + I.zz * a.z);
    return out;
  }
  template <bool kPaired>
  [[gnu::always_inline]] static V product(const V6<V>& a, const V6<V>& b) {
    if constexpr (!kPaired) return dot(a, b);
    return (a.n.x * b.n.x + (a.n.z * b.n.z + a.f.y * b.f.y)) +
           (a.n.y * b.n.y + (a.f.x * b.f.x + a.f.z * b.f.z));
  }

  /// Inertia of each node with all that it carries, as its rotational part in A and its mass and the moment
  /// of that in p, and the force U = I S of a unit acceleration of the node (Featherstone 2008, section 6.2).
  template <bool kPaired>
  static Works find_composites(const LaneTree& tree) {
    const Works works = works_of(tree);
    for (int i = 0; i < tree.batches; ++i) {
      const Batches& b = batches(tree)[i];
      Work<W>& w = works[i];
      const V zero = 0.0;
      const V3<V> none = {zero, zero, zero};
      store_sym(w.A, b.massless ? Sym3<V>{zero, zero, zero, zero, zero, zero} : load_sym(b.I));
      store3(w.p, b.massless ? none : load3(b.h));
      store(w.p[3], b.massless ? zero : load(b.mass));
    }
    for (int i = tree.batches - 1; i >= 0; --i) {
      const Batches& b = batches(tree)[i];
      Work<W>& w = works[i];
      const Sym3<V> I = load_sym(w.A);
      const V3<V> h = load3(w.p);
      const V mass = load(w.p[3]);
      if (single(b)) {
        const V6<V> S = load6(b.S);
        store6(w.U, {product<kPaired>(I, S.n) + cross(h, S.f), cross(S.n, h) + mass * S.f});
      }
      if (b.link == ParentLink::aligned) {
        Work<W>& to = works[b.parent];
        store_sym(to.A, load_sym(to.A) + I);
        store3(to.p, load3(to.p) + h);
        store(to.p[3], load(to.p[3]) + mass);
      } else if (b.link == ParentLink::gathered) {
        for (int lane = b.used - 1; lane >= 0; --lane) {
          Work<W>& to = works[b.parent_batch[lane]];
          const int at = b.parent_lane[lane];
          for (int k = 0; k < 6; ++k) to.A[k][at] += w.A[k][lane];
          for (int k = 0; k < 4; ++k) to.p[k][at] += w.p[k][lane];
        }
      }
    }
    return works;
  }

  template <bool kPaired>
  static void inertia(const LaneTree& tree, double* out) {
    const Works works = find_composites<kPaired>(tree);
    for (int i = 0; i < tree.batches; ++i) {
      const Batches& b = batches(tree)[i];
      if (!single(b)) continue;
      const V6<V> force = load6(works[i].U);
      const Batches* over = &b;
      while (true) {
        store_loose(out, product<kPaired>(load6(over->S), force));
        out += W;
        if (over->link != ParentLink::aligned) break;
        over = &batches(tree)[over->parent];
      }
      if (over->link == ParentLink::base) continue;
      // From here on, each lane has its own. Those without a node repeat the first.
      int batch[W], lane[W];
      for (int l = 0; l < W; ++l) {
        const int of = l < b.used ? l : 0;
        batch[l] = over->parent_batch[of];
        lane[l] = over->parent_lane[of];
      }
      while (true) {
        alignas(64) Lane<W> S[6];
        for (int l = 0; l < W; ++l)
          for (int k = 0; k < 6; ++k) S[k][l] = batches(tree)[batch[l]].S[k][lane[l]];
        store_loose(out, product<kPaired>(load6(S), force));
        out += W;
        if (batches(tree)[batch[0]].link == ParentLink::base) break;
        for (int l = 0; l < W; ++l) {
          const Batches& at = batches(tree)[batch[l]];
          batch[l] = at.link == ParentLink::aligned ? at.parent : at.parent_batch[lane[l]];
          lane[l] = at.link == ParentLink::aligned ? lane[l] : at.parent_lane[lane[l]];
        }
      }
    }
  }

  static bool accelerate(const LaneTree& tree, double step) {
    const Works works = cleared(tree);
    for (int i = tree.batches - 1; i >= 0; --i) {
      const Batches& b = batches(tree)[i];
      if (single(b)) Forces<V>::prepare_axis(tree, b, step);
      inward_any(tree, works, i);
    }
    bool sound = true;
    for (int i = 0; i < tree.batches; ++i) {
      const Batches& b = batches(tree)[i];
      outward_any(tree, works, i);
      if (single(b)) sound = Forces<V>::correct(tree, b, step, false) && sound;
    }
    return sound;
  }

  static Works works_of(const LaneTree& tree) {
    return thread_work<W>(static_cast<std::size_t>(tree.batches));
  }

  static Works cleared(const LaneTree& tree) {
    const Works works = works_of(tree);
    const V zero = 0.0;
    for (int i = 0; i < tree.batches; ++i) {
      if (!batches(tree)[i].cleared) continue;
      Handed<W>* const to = works + i;
      Handed<W>::each_field([to, &zero](auto field) {
        for (auto& lanes : to->*field) store(lanes, zero);
      });
    }
    return works;
  }

  static void inward(const LaneTree& tree, Batches& b, Works works, Work<W>& w) {
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
    const Inertia<V> handed = {less(I.A, inverse, U.n), less(I.B, inverse, U.n, U.f),
                               less(I.C, inverse, U.f)};
    const V6<V> c = load6(b.c);
    add_to_parent(b, works, handed, p + handed * c + rate * U);
  }

  static void outward(const LaneTree& tree, Batches& b, const Work<W>& w) {
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
  static void inward_many(const LaneTree& tree, Batches& b, Works works, const Work<W>& w) {
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

  /// A free body that carries nothing. Its axes are the world's through its centre of mass, where turning and
  /// shifting are apart: the same as by 6 x 6 blocks, to the bit, without their zeros.
  static void inward_lone(const LaneTree& tree, Batches& b) {
    const Joints3& joint = joint3(tree, b);
    Work3<W>& w = work3(b);
    const Sym3<V> I = load_sym(b.I);
    const V6<V> p = load6(b.pv);
    const V3<V> columns[3] = {{I.xx, I.xy, I.xz}, {I.xy, I.yy, I.yz}, {I.xz, I.yz, I.zz}};
    for (int j = 0; j < 3; ++j) store3(w.D[j], columns[j]);
    factor<3>(w.D);
    const V firm = V(1.0) / square_root(load(b.mass));
    store(w.D[3][3], firm);
    V u[3] = {load(joint.tau[0]) - p.n.x, load(joint.tau[1]) - p.n.y, load(joint.tau[2]) - p.n.z};
    solve_factored<3>(w.D, u);
    const V3<V> f = {load(joint.tau[3]) - p.f.x, load(joint.tau[4]) - p.f.y, load(joint.tau[5]) - p.f.z};
    store6(w.rate, {{u[0], u[1], u[2]}, {f.x * firm * firm, f.y * firm * firm, f.z * firm * firm}});
  }

  static void outward_lone(const LaneTree& tree, Batches& b) {
    const Work3<W>& w = work3(b);
    Frames scratch;
    const V6<V> a = load6(parent(tree, b, scratch).a) + load6(b.c), rate = load6(w.rate);
    const V3<V> moment = load_sym(b.I) * a.n;
    V x[3] = {moment.x, moment.y, moment.z};
    solve_factored<3>(w.D, x);
    const V mass = load(b.mass), firm = load(w.D[3][3]);
    const auto shifted = [&](const V& own, const V& carried) { return own - mass * carried * firm * firm; };
    const V6<V> du = {{rate.n.x - x[0], rate.n.y - x[1], rate.n.z - x[2]},
                      {shifted(rate.f.x, a.f.x), shifted(rate.f.y, a.f.y), shifted(rate.f.z, a.f.z)}};
    const V all[6] = {du.n.x, du.n.y, du.n.z, du.f.x, du.f.y, du.f.z};
    for (int j = 0; j < 6; ++j) store(tree.du + b.u + j * W, all[j]);
    store6(b.frame.a, a + du);
  }

  template <int N>
  static void outward_many(const LaneTree& tree, Batches& b) {
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
};

}  // namespace handsim::engine::articulated
