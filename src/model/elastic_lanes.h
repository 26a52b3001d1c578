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

/// Where fibres of a length reach along the tendon [m].
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
};

/// Pull of fibres along the tendon at the end of a step, and its derivative by their reach.
template <class V>
[[gnu::always_inline]] inline HillCurve<V> elastic_fibres(const HillConstants<V>& m, const ElasticStep<V>& of,
                                                          const V& reach) {
  const V length = square_root(V(m.height + reach * reach)), cosine = reach / length, zero = 0.0;
  const V bend = m.height / (length * length * length);
  const V per = cosine * m.per_length, rate = (reach - of.start) * of.per_step, x = rate * per;
  const V l = length / m.length, steeper = of.per_step * per + rate * bend * m.per_length;
  const HillCurve<V> passive = hill_passive(l), active = hill_active(l);
  const V top = (0.25 + 0.75 * of.activation) * m.max_speed;
  const HillCurve<V> speed = hill_speed(x, top);
  // Of both hyperbolas: the square of the chord to rest over the slope at rest.
  const V flat =
      select(x < zero, V(1 / (1 + 1 / hill::kSpeedShape)), V(1 / (hill::kSteep * (hill::kLengthening - 1))));
  const V tangent = select(x + top <= zero, zero, V(speed.slope * speed.slope * top * flat));
  const V drag = 1.0 + m.drag * x;
  const V force = of.activation * active.value * speed.value + passive.value * drag;
  const V by_length = of.activation * active.slope * speed.value + passive.slope * drag;
  const V by_speed = of.activation * active.value * tangent + passive.value * m.drag;
  const V slope = cosine * (by_length * per + by_speed * steeper) + force * bend;
  const auto pulls = force > zero;
  return {select(pulls, V(m.force * cosine * force), zero), select(pulls, V(m.force * slope), zero)};
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
template <class V>
[[gnu::always_inline]] inline ElasticPull<V> elastic_pull(const HillConstants<V>& m,
                                                          const ElasticStep<V>& of) {
  constexpr int kMost = 60;
  // Of Newton's last step: the error that it leaves goes with its square.
  const V zero = 0.0, near = 1e-8 * m.length;
  V low = m.least, high = greater(of.taut, m.least);
  const auto slack = !(elastic_fibres(m, of, high).value > zero) || of.taut <= m.least;
  const V cosine = of.start / square_root(V(m.height + of.start * of.start));
  const V fastest = of.step * (0.25 + 0.75 * of.activation) * m.max_speed * m.length / cosine;
  const V loose = greater(high, V(of.start - fastest));
  const auto follows = slack && loose <= high;
  V reach = select(slack, loose, smaller(greater(of.start, low), high));
  auto done = slack;
  for (int i = 0; i < kMost && any(!done); ++i) {
    const HillCurve<V> fibres = elastic_fibres(m, of, reach);
    const HillCurve<V> tendon = tendon_curve(V((of.taut - reach) * of.per_stretch));
    const V off = fibres.value - m.force * tendon.value;
    const auto strong = off > zero;
    high = select(strong, reach, high);
    low = select(strong, low, reach);
    const V newton = reach - off / (fibres.slope + m.force * of.per_stretch * tendon.slope);
    const V next = select(newton >= low && newton <= high, newton, V(0.5 * (low + high)));
    const auto there = next - reach <= near && reach - next <= near;
    reach = select(done, reach, next);
    done = done || there;
  }
  const HillCurve<V> tendon = tendon_curve(V((of.taut - reach) * of.per_stretch));
  // As a rigid tendon's: by the chord of the speed to rest, so that a step does not overshoot.
  const HillTension<V> fibres =
      hill_tension(m, V(m.reach - reach), V((reach - of.start) * of.per_step), of.activation);
  const V soft = greater(fibres.stiffness, zero) + fibres.damping * of.per_step;
  const V hard = m.force * of.per_stretch * tendon.slope;
  const auto taut = hard > zero;
  const V share = select(taut, V(hard / select(taut, V(soft + hard), V(1.0))), zero);
  return {reach, m.force * tendon.value, share * soft, select(follows, V(1.0), share)};
}

}  // namespace handsim::model
