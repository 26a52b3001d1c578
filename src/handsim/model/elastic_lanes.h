// Fibres in series with an elastic tendon, for any number type as hill_lanes.h and with its curves. Fibres
// with the reach w along the tendon pull as hard as the tendon does:
//   F(w, w', a) = T(s),   s = (taut - w) / stretch,   taut: the reach that leaves the tendon its slack length
// T, over the largest isometric force, is the curve of Thelen 2003 (the paper of muscle_curves.h, eq. 5) by
// strain over that at this force: 0 below 0, 0.33 (exp(3 s / toe) - 1) / (exp(3) - 1) up to the toe, and its
// tangent beyond; the toe is where this goes through 1 at 1. With a slack tendon fibres shorten at their
// fastest speed. A step solves this for w at its end, with w' by backward Euler: stable at any stiffness.
#pragma once

#include "handsim/model/hill_lanes.h"

namespace handsim::model {

namespace hill {
inline constexpr double kToeShape = 3;                   ///< k_toe
inline constexpr double kToeForce = 0.33;                ///< tension at the toe's end
inline constexpr double kToeGrown = 20.085536923187668;  ///< exp(k_toe)
/// Slope at the toe's end times the toe, by which the tangent reaches 1 at 1.
inline constexpr double kToeRise = kToeShape * kToeForce * kToeGrown / (kToeGrown - 1);
inline constexpr double kToe = kToeRise / (kToeRise + 1 - kToeForce);
}  // namespace hill

/// Tension of a tendon over the largest isometric force. @param s strain over that at this force
template <class V>
[[gnu::always_inline]] inline HillCurve<V> tendon_curve(const V& s) {
  return hill_stretched(s, hill::kToeShape, hill::kToe, hill::kToeForce / (hill::kToeGrown - 1));
}

/// The length of fibres along the tendon [m].
template <class V>
[[gnu::always_inline]] inline V fibre_reach(const HillConstants<V>& m, const V& length) {
  return greater(square_root(greater(V(length * length - m.height), V(m.least * m.least))), m.least);
}

/// Fibres and tendon during one step, or at rest.
template <class V>
struct ElasticStep {
  V per_stretch = 1.0;  ///< 1 / stretch of the tendon at the largest isometric force [1/m]
  V taut = 0.0;         ///< reach of the fibres at which the tendon is just slack, at the end [m]
  V start = 0.0;        ///< reach of the fibres at the start [m]
  V step = 0.0;         ///< [s]
  V per_step = 0.0;     ///< 1 / step, or 0 at rest [1/s]
  V activation = 0.0;   ///< at the end
  HillBridges<V> bridges = {};
};

/// Pull of fibres along the tendon at the end of a step.
template <class V>
struct ElasticFibres {
  V force = 0.0;  ///< [N]
  V slope = 0.0;  ///< by their reach [N/m]
  V bound = 0.0;  ///< the same by the chord of the speed to rest, without a negative slope of the length
};

template <bool kBridged = false, class V>
[[gnu::always_inline]] inline ElasticFibres<V> elastic_fibres(const HillConstants<V>& m,
                                                              const ElasticStep<V>& of, const V& reach) {
  const V length = square_root(V(m.height + reach * reach)), cosine = reach / length, zero = 0.0;
  const V bend = m.height / (length * length * length);
  const V per = cosine * m.per_length, rate = (reach - of.start) * of.per_step, x = rate * per;
  const V l = length / m.length, steeper = of.per_step * per + rate * bend * m.per_length;
  const HillCurve<V> passive = hill_passive(l), active = hill_active(l);
  const V top = top_speed(m, of.activation), own = kBridged ? contractile_rate(x, top, of.bridges) : x;
  HillCurve<V> speed = hill_speed(own, top);
  // On both hyperbolas the tangent is the square of the chord to rest over the slope at rest.
  const V flat = select(own < zero, V(1 / (1 + 1 / hill::kSpeedShape)),
                        V(1 / (hill::kSteep * (hill::kLengthening - 1))));
  V tangent = select(own + top <= zero, zero, V(speed.slope * speed.slope * top * flat));
  if constexpr (kBridged) {
    const V soft = of.bridges.softness * of.bridges.per_step;
    tangent = tangent / (1.0 + soft * tangent);
    speed.slope = speed.slope / (1.0 + soft * speed.slope);
  }
  const V drag = 1.0 + m.drag * x, pull = of.activation * active.value, damping = passive.value * m.drag;
  const V force = pull * speed.value + passive.value * drag;
  const V by_length = (of.activation * active.slope * speed.value + passive.slope * drag) * per;
  const V slope = cosine * (by_length + (pull * tangent + damping) * steeper) + force * bend;
  const V bound = cosine * (greater(by_length, zero) + (pull * speed.slope + damping) * of.per_step * per);
  const auto pulls = force > zero;
  return {select(pulls, V(m.force * cosine * force), zero), select(pulls, V(m.force * slope), zero),
          select(pulls, V(m.force * bound), zero)};
}

/// @returns whether fibres pull at a reach, as elastic_fibres() finds, without its curves
template <bool kBridged = false, class V>
[[gnu::always_inline]] inline auto fibres_pull(const HillConstants<V>& m, const ElasticStep<V>& of,
                                               const V& reach) {
  const V length = square_root(V(m.height + reach * reach)), zero = 0.0;
  const V l = length / m.length, x = (reach - of.start) * of.per_step * (reach / length) * m.per_length;
  const V top = top_speed(m, of.activation), own = kBridged ? contractile_rate(x, top, of.bridges) : x;
  const auto active = of.activation > zero && l >= hill::kShortest && l <= hill::kLongest && own + top > zero;
  return active || (l > 1.0 && 1.0 + m.drag * x > zero);
}

/// Reach at the end with the curves of length, and the line of the tendon's, at the start: their equilibrium
/// with the hyperbola of the speed, a quadratic equation of the rate.
template <class V>
[[gnu::always_inline]] inline V elastic_guess(const HillConstants<V>& m, const ElasticStep<V>& of) {
  const V length = square_root(V(m.height + of.start * of.start)), zero = 0.0;
  const V cosine = of.start / length, l = length / m.length, per = cosine * m.per_length * of.per_step;
  const HillCurve<V> passive = hill_passive(l), active = hill_active(l);
  const HillCurve<V> tendon = tendon_curve(V((of.taut - of.start) * of.per_stretch));
  const V top = top_speed(m, of.activation), pull = of.activation * active.value;
  // pull (top + p x) / (top + q x) + drag x = load
  const V load = tendon.value / cosine - passive.value;
  const V drag = passive.value * m.drag + (tendon.slope * of.per_stretch / cosine) / per +
                 (passive.slope + of.activation * greater(active.slope, zero)) * cosine * m.per_length / per;
  const auto shortens = load < pull;
  const V p = select(shortens, V(1.0), V(hill::kSteep * hill::kLengthening));
  const V q = select(shortens, V(-1 / hill::kSpeedShape), V(hill::kSteep));
  const V b = pull * p + drag * top - load * q, c = (pull - load) * top;
  const V x = -2.0 * c / (b + square_root(greater(V(b * b - 4.0 * drag * q * c), zero)));
  return of.start + greater(x, V(zero - top)) / per;
}

/// Equilibrium at the end of a step.
template <class V>
struct ElasticPull {
  V reach = 0.0;      ///< of the fibres [m]
  V force = 0.0;      ///< tension [N]
  V stiffness = 0.0;  ///< of both in series, by the length of muscle and tendon at the end [N/m]
  V share = 0.0;      ///< of such a change of length that the fibres take
};

/// Newton's method within a bracket: fibres pull more than the tendon at its slack length and less where they
/// have no reach. The same result for a lane whatever the others are.
template <bool kBridged = false, class V>
[[gnu::always_inline]] inline ElasticPull<V> elastic_pull(const HillConstants<V>& m,
                                                          const ElasticStep<V>& of) {
  constexpr int kNewton = 20, kMost = 60;
  // Newton's method ends with a step below `near`: the error left is of the order of its square.
  const V zero = 0.0, near = 1e-8 * m.length;
  V low = m.least, high = greater(of.taut, m.least);
  const auto slack = !fibres_pull<kBridged>(m, of, high) || of.taut <= m.least;
  const V cosine = of.start / square_root(V(m.height + of.start * of.start));
  const V fastest = of.step * (0.25 + 0.75 * of.activation) * m.max_speed * m.length / cosine;
  const V loose = greater(high, V(of.start - fastest));
  const auto follows = slack && loose <= high;
  ElasticPull<V> out;
  out.reach = loose;
  out.share = select(follows, V(1.0), zero);
  auto done = slack;
  if (!any(!done)) return out;
  const V guess = elastic_guess(m, of);
  V reach = select(guess > low && guess < high, guess, smaller(greater(of.start, low), high));
  for (int i = 0; i < kMost && any(!done); ++i) {
    const ElasticFibres<V> fibres = elastic_fibres<kBridged>(m, of, reach);
    const HillCurve<V> tendon = tendon_curve(V((of.taut - reach) * of.per_stretch));
    const V hard = m.force * of.per_stretch * tendon.slope, off = fibres.force - m.force * tendon.value;
    const auto strong = off > zero;
    high = select(strong, reach, high);
    low = select(strong, low, reach);
    const V newton = reach - off / (fibres.slope + hard), middle = 0.5 * (low + high);
    // At the ends of the active curve, where it jumps, the bracket alone converges.
    const V next = i < kNewton ? select(newton >= low && newton <= high, newton, middle) : middle;
    const auto there = !done && next - reach <= near && reach - next <= near;
    // The tension on the tendon's tangent: exact to the square of this last step, too.
    const V share = select(hard > zero, V(hard / (fibres.bound + hard)), zero);
    out.reach = select(there, next, out.reach);
    out.force = select(there, V(m.force * tendon.value + hard * (reach - next)), out.force);
    out.stiffness = select(there, V(share * fibres.bound), out.stiffness);
    out.share = select(there, share, out.share);
    done = done || there;
    reach = next;
  }
  return out;
}

}  // namespace handsim::model
