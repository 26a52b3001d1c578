// The arithmetic of tendon_lanes.h, written once for any number of lanes at a time. Included by the
// tendon_kernel_*.cpp files only; `Number`, the widest of the instruction set, keeps what each builds apart.
#pragma once

#include "handsim/engine/tendon_lanes.h"
#include "handsim/model/elastic_lanes.h"

namespace handsim::engine {

template <class Number>
struct TendonOperations {
  static constexpr int W = Number::size() >= kTendonLanes ? kTendonLanes : 2;
  using V = model::stdx::resize_simd_t<W, Number>;

  [[gnu::always_inline]] static inline V load(const double* x) { return V(x, model::stdx::element_aligned); }
  [[gnu::always_inline]] static inline void store(double* to, const V& x) {
    x.copy_to(to, model::stdx::element_aligned);
  }
  [[gnu::always_inline]] static inline void add(double* to, const V& x) { store(to, load(to) + x); }
  [[gnu::always_inline]] static inline V power(const V& x, int n) {
    V out = 1.0;
    for (; n > 0; --n) out = out * x;
    return out;
  }

  /// Polynomials of the arms at lane l on. Returns the sum of their integrals.
  static V find_arms(const TendonArrays& all, const TendonBlock& block, int l) {
    const V zero = 0.0;
    V excursion = zero;
    ArmRow* arms = all.arm + block.first_arm;
    for (ArmRow* a = arms; a != arms + block.arms; ++a) {
      const V angle = load(all.coordinate[a->coordinate].q + l);
      const V x = model::smaller(model::greater(angle, load(a->low + l)), load(a->high + l));
      V r = zero, slope = zero, sum = zero;
      for (int t = a->terms - 1; t >= 0; --t) {
        slope = slope * x + r;
        r = r * x + load(a->c[t] + l);
        sum = sum * x + load(a->integral[t] + l);
      }
      store(a->within + l, x);
      store(a->arm + l, r);
      store(a->bend + l, model::select(x == angle, slope, zero));
      excursion = excursion + (sum * x + r * (angle - x));
    }
    const ProductRow* products = all.product + block.first_product;
    for (const ProductRow* p = products; p != products + block.products; ++p) {
      const V factor = load(p->factor + l);
      ArmRow &a = arms[p->a], &b = arms[p->b];
      const V xa = load(a.within + l), xb = load(b.within + l);
      const V pa = power(xa, p->power_a), pb = power(xb, p->power_b);
      excursion = excursion + factor * pa * pb;
      change(all, a, xa, p->power_a, V(factor * pb), l);
      change(all, b, xb, p->power_b, V(factor * pa), l);
    }
    return excursion;
  }
  /// Adds factor d(x^n)/dx to an arm where x follows the angle.
  [[gnu::always_inline]] static inline void change(const TendonArrays& all, ArmRow& arm, const V& x, int n,
                                                   const V& factor, int l) {
    const V zero = 0.0;
    const auto inside = x == load(all.coordinate[arm.coordinate].q + l);
    add(arm.arm + l, model::select(inside, V(factor * double(n) * power(x, n - 1)), zero));
    if (n > 1)
      add(arm.bend + l, model::select(inside, V(factor * double(n) * double(n - 1) * power(x, n - 2)), zero));
  }

  /// Force at the rate of the start and the length of the end, and its slope by the rate.
  struct Pull {
    V force, slope;
  };
  [[gnu::always_inline]] static inline model::HillConstants<V> hill_of(const TendonBlock& b, int l) {
    return {load(b.strength + l), load(b.length + l), load(b.per_length + l), load(b.height + l),
            load(b.reach + l),    load(b.least + l),  load(b.max_speed + l),  load(b.drag + l)};
  }
  [[gnu::always_inline]] static inline V activate(TendonBlock& b, const double* excitations, const V& step,
                                                  int l) {
    V excitation = 0.0;
    if (excitations)
      excitation = V([&](auto i) {
        const int lane = static_cast<int>(i) + l, muscle = b.tendon[lane];
        return muscle == kNoTendon ? 0 : excitations[muscle] * b.excitable[lane];
      });
    const V activation =
        model::hill_activation(load(b.up + l), load(b.down + l), load(b.activation + l), excitation, step);
    store(b.activation + l, activation);
    return activation;
  }
  [[gnu::always_inline]] static inline model::HillBridges<V> bridges_of(const BridgeRow* row, const V& step,
                                                                        int l) {
    if (!row) return {};
    return {load(row->softness + l), load(row->stretch + l), V(1.0 / step)};
  }
  /// @param bridges null unless `kBridged`
  template <bool kBridged>
  [[gnu::always_inline]] static inline Pull pull_muscles(TendonBlock& b, BridgeRow* bridges,
                                                         const V& excursion, const V& rate,
                                                         const double* excitations, const V& step, int l) {
    const V activation = activate(b, excitations, step, l), zero = 0.0;
    const model::HillConstants<V> hill = hill_of(b, l);
    const model::HillTension<V> found =
        model::hill_tension<kBridged>(hill, excursion, rate, activation, bridges_of(bridges, step, l));
    if constexpr (kBridged)
      store(bridges->per + l, model::hill_fibre(hill, excursion).cosine * hill.per_length);
    return {model::greater(V(found.force + step * found.stiffness * rate), zero),
            V(step * model::greater(found.stiffness, zero) + found.damping)};
  }
  template <bool kBridged>
  static Pull pull_elastic(TendonBlock& b, ElasticRow& row, const BridgeRow* bridges, const V& excursion,
                           const V& rate, const double* excitations, const V& step, int l) {
    const V activation = activate(b, excitations, step, l);
    const model::HillConstants<V> hill = hill_of(b, l);
    const model::ElasticStep<V> of = {load(row.per_stretch + l),
                                      V(hill.reach - excursion + step * rate),
                                      model::fibre_reach(hill, load(row.fibre + l)),
                                      step,
                                      V(1.0 / step),
                                      activation,
                                      bridges_of(bridges, step, l)};
    const model::ElasticPull<V> found = model::elastic_pull<kBridged>(hill, of);
    store(row.reach + l, found.reach);
    store(row.share + l, step * found.share);
    return {found.force, V(step * found.stiffness)};
  }
  /// The rates of a step's end tell where its fibres, and their cross-bridges, are.
  template <bool kElastic, bool kBridged>
  static void end_fibres(const TendonArrays& all, TendonBlock& b, const V& step, int l) {
    const V speed = rate_of(all, b, l);
    V rate = speed;
    if constexpr (kElastic) {
      ElasticRow& row = all.elastic[b.elastic];
      const V faster = speed - load(b.rate + l);
      const V reach =
          model::greater(V(load(row.reach + l) + load(row.share + l) * faster), load(b.least + l));
      const V length = model::square_root(V(load(b.height + l) + reach * reach));
      if constexpr (kBridged)
        rate = (reach - model::fibre_reach(hill_of(b, l), load(row.fibre + l))) * (1.0 / step) *
               (reach / length) * load(b.per_length + l);
      store(row.fibre + l, length);
    }
    if constexpr (kBridged) {
      BridgeRow& row = all.bridges[b.bridges];
      if constexpr (!kElastic) rate = rate * load(row.per + l);
      const V top = model::top_speed(hill_of(b, l), load(b.activation + l));
      store(row.stretch + l, model::bridge_stretch(rate, top, bridges_of(&row, step, l), step));
    }
  }
  [[gnu::always_inline]] static inline Pull pull_bands(const TendonBlock& b, const V& excursion,
                                                       const V& rate, const V& step, int l) {
    const V k = load(b.stiffness + l), d = load(b.damping + l), zero = 0.0;
    const V then = zero - excursion - load(b.rest + l) + step * rate;
    const V force = k * then + d * rate;
    const auto one_way = load(b.one_way + l) > zero;
    const auto slack = one_way && then <= zero;
    return {model::select(slack || (one_way && force < zero), zero, force),
            model::select(slack, zero, V(step * k + d))};
  }

  /// Rate of the length of muscle and tendon [m/s], with the arms last stored.
  [[gnu::always_inline]] static inline V rate_of(const TendonArrays& all, const TendonBlock& b, int l) {
    const ArmRow* arms = all.arm + b.first_arm;
    V rate = 0.0;
    for (int i = 0; i < b.arms; ++i)
      rate = rate - load(arms[i].arm + l) * load(all.coordinate[arms[i].coordinate].u + l);
    return rate;
  }

  /// Apart for elastic tendons and cross-bridges, whose calls would take the registers of the others.
  template <bool kElastic, bool kBridged>
  [[gnu::noinline]] static void pull_block(const TendonArrays& all, TendonBlock& b, const double* excitations,
                                           double h, bool goes_on, int l) {
    const V step = h, zero = 0.0;
    if constexpr (kElastic || kBridged)
      if (goes_on) end_fibres<kElastic, kBridged>(all, b, step, l);
    const V excursion = find_arms(all, b, l);
    const ArmRow* arms = all.arm + b.first_arm;
    const V rate = rate_of(all, b, l);
    Pull pull;
    BridgeRow* bridges = kBridged ? all.bridges + b.bridges : nullptr;
    if constexpr (kElastic)
      pull =
          pull_elastic<kBridged>(b, all.elastic[b.elastic], bridges, excursion, rate, excitations, step, l);
    else
      pull = b.muscles ? pull_muscles<kBridged>(b, bridges, excursion, rate, excitations, step, l)
                       : pull_bands(b, excursion, rate, step, l);
    store(b.excursion + l, excursion);
    store(b.rate + l, rate);
    store(b.force + l, pull.force);
    store(b.slope + l, pull.slope);
    const int* pair = all.pair + b.first_pair;
    for (int i = 0; i < b.arms; ++i) {
      CoordinateRow& to = all.coordinate[arms[i].coordinate];
      const V r = load(arms[i].arm + l), steep = r * pull.slope;
      add(to.torque + l, r * pull.force);
      // An arm that grows against the motion holds the coordinate like a spring.
      const V held = model::greater(V(zero - load(arms[i].bend + l) * pull.force), zero);
      V own = steep * r + step * held;
      for (int j = 0; j < i; ++j, ++pair) {
        const V entry = steep * load(arms[j].arm + l);
        if (*pair != kBounded) {
          add(all.sum[*pair].sum + l, entry);
        } else {
          const V bound = model::greater(entry, V(zero - entry));
          own = own + bound;
          add(all.coordinate[arms[j].coordinate].own + l, bound);
        }
      }
      add(to.own + l, own);
    }
  }

  static void pull_bridged(const TendonArrays& all, TendonBlock& b, const TendonInput& in, int l) {
    if (b.elastic == kRigid)
      pull_block<false, true>(all, b, in.excitations, in.step, in.goes_on, l);
    else
      pull_block<true, true>(all, b, in.excitations, in.step, in.goes_on, l);
  }

  static void pull(const TendonArrays& all, const TendonInput& in) {
    const V zero = 0.0;
    for (CoordinateRow* c = all.coordinate; c != all.coordinate + all.coordinates; ++c)
      for (int l = 0; l < kTendonLanes; l += W) {
        store(c->q + l, V([&](auto i) { return in.q[c->dof[static_cast<int>(i) + l]]; }));
        store(c->u + l, V([&](auto i) { return in.u[c->dof[static_cast<int>(i) + l]]; }));
        store(c->torque + l, zero);
        store(c->own + l, zero);
      }
    for (PairRow* s = all.sum; s != all.sum + all.pairs; ++s)
      for (int l = 0; l < kTendonLanes; l += W) store(s->sum + l, zero);
    for (TendonBlock* b = all.block; b != all.block + all.blocks; ++b)
      for (int l = 0; l < kTendonLanes; l += W)
        if (b->bridges != kRigid)
          pull_bridged(all, *b, in, l);
        else if (b->elastic == kRigid)
          pull_block<false, false>(all, *b, in.excitations, in.step, in.goes_on, l);
        else
          pull_block<true, false>(all, *b, in.excitations, in.step, in.goes_on, l);
  }

  static constexpr TendonKernel kernel(const char* name) { return {name, pull}; }
};

}  // namespace handsim::engine
