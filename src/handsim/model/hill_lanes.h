// The curves of muscle_curves.h for a double, or a vector register with one muscle a lane: the same bits.
#pragma once

#include "handsim/model/lane_math.h"
#include "handsim/model/muscle_curves.h"

namespace handsim::model {

/// The numbers of muscles from which their tensions are computed.
template <class V>
struct HillConstants {
  V force = 0.0;
  V length = 1.0;      ///< optimal [m]
  V per_length = 1.0;  ///< 1 / length [1/m]
  V height = 0.0;      ///< square of the distance between the fibres' ends across the tendon [m^2]
  V reach = 1.0;       ///< of the fibres along the tendon at no excursion [m]
  V least = 1.0;       ///< of the same at any [m]
  V max_speed = 1.0;   ///< [optimal lengths/s]
  V drag = 0.0;        ///< damping of the passive part [s]
};

template <class V>
struct HillFibre {
  V length, cosine;
};

template <class V>
[[gnu::always_inline]] inline HillFibre<V> hill_fibre(const HillConstants<V>& m, const V& excursion) {
  const V along = greater(V(m.reach - excursion), m.least);
  const V length = square_root(V(m.height + along * along));
  return {length, along / length};
}

/// A factor of the force and its derivative.
template <class V>
struct HillCurve {
  V value = 0.0, slope = 0.0;
};

template <class V>
[[gnu::always_inline]] inline HillCurve<V> hill_active(const V& l) {
  const V x = l - 1.0, far = hill::kLongest - 1, zero = 0.0;
  static_assert(hill::kLongest - 1 == 1 - hill::kShortest);
  const V within = smaller(greater(x, V(zero - far)), far);
  const V value = exponential(V(within * within * (-1 / hill::kActiveWidth)));
  const auto inside = x == within;
  return {select(inside, value, zero), select(inside, V(x * (-2 / hill::kActiveWidth) * value), zero)};
}

/// `over` (exp(shape x / end) - 1) of an x above 0, beyond `end` along its tangent.
template <class V>
[[gnu::always_inline]] inline HillCurve<V> hill_stretched(const V& x, double shape, double end, double over) {
  const V zero = 0.0, most = end;
  const auto taut = x > zero;
  if (!any(taut)) return {};
  const V curved = smaller(greater(x, zero), most);
  const V grown = exponential(V(curved * (shape / end)));
  const V slope = grown * (shape / end * over);
  const V value = (grown - 1.0) * over + slope * (x - curved);
  return {select(taut, value, zero), select(taut, slope, zero)};
}

template <class V>
[[gnu::always_inline]] inline HillCurve<V> hill_passive(const V& l) {
  constexpr double kOver = 1 / 147.4131591025766;  // 1 / (exp(k_PE) - 1)
  return hill_stretched(V(l - 1.0), hill::kPassiveShape, hill::kPassiveStrain, kOver);
}

/// Factor of the speed; its slope is divided by `top`. @param rate of normalised fibres, @param top largest
/// speed at the activation. The slope is the chord's to rest, above the tangent's: no linear step overshoots.
template <class V>
[[gnu::always_inline]] inline HillCurve<V> hill_speed(const V& rate, const V& top) {
  constexpr double kShorten = 1 / hill::kSpeedShape, kGrow = hill::kSteep * hill::kLengthening;
  const V zero = 0.0;
  const auto shortens = rate < zero;
  const auto beyond = rate + top <= zero;
  V below = select(shortens, V(top - rate * kShorten), V(top + rate * hill::kSteep));
  V above = select(shortens, V(top + rate), V(top + rate * kGrow));
  V steep = select(shortens, V(1 + kShorten), V(hill::kSteep * (hill::kLengthening - 1)));
  below = select(beyond, V(zero - rate), below);
  above = select(beyond, zero, above);
  steep = select(beyond, V(1.0), steep);
  const V inverse = 1.0 / below;
  return {above * inverse, steep * inverse};
}

/// Cross-bridges in series with the part of the fibres that contracts, which hill_speed() describes. Their
/// stiffness is in proportion to the active force, K = gamma F / optimal length (Cui 2008, J Biomech
/// 41:1945), so that at constant activation and length the factor of the speed is 1 + gamma s, s their
/// stretch:
///   hill_speed(x - ds/dt) = 1 + gamma s
/// Small and fast changes of length meet a spring, slow ones the curve of the speed, as without
/// cross-bridges.
template <class V>
struct HillBridges {
  V softness = 0.0;  ///< 1 / gamma; 0: rigid
  V stretch = 0.0;   ///< at the start of the step [optimal lengths]
  V per_step = 0.0;  ///< 1 / step [1/s]
};

/// Rate at which the contractile part lengthens at the end of a step [optimal lengths/s], by backward Euler:
/// a quadratic equation on either hyperbola. @param rate of the normalised fibres, @param top as in
/// hill_speed()
template <class V>
[[gnu::always_inline]] inline V contractile_rate(const V& rate, const V& top, const HillBridges<V>& bridges) {
  // y + soft hill_speed(y) = all; with z, y without its sign: a z^2 + p z = c.
  const V soft = bridges.softness * bridges.per_step, zero = 0.0;
  const V all = rate + bridges.stretch * bridges.per_step + soft, off = all - soft;
  constexpr double kShorten = 1 / hill::kSpeedShape, kGrow = hill::kSteep * hill::kLengthening;
  const auto shortens = off < zero;
  const V a = select(shortens, V(kShorten), V(hill::kSteep));
  const V p = top + select(shortens, V(soft + kShorten * all), V(kGrow * soft - hill::kSteep * all));
  const V c = top * select(shortens, V(zero - off), off);
  const V root = square_root(V(p * p + 4.0 * a * c));
  const V z = select(p > zero, V(2.0 * c / (greater(p, zero) + root)), V((root - p) / (2.0 * a)));
  return select(all + top <= zero, all, select(shortens, V(zero - z), z));
}

/// hill_speed() with cross-bridges: its slope, divided by `top` too, is still above the tangent's.
template <class V>
[[gnu::always_inline]] inline HillCurve<V> bridged_speed(const V& rate, const V& top,
                                                         const HillBridges<V>& bridges) {
  const HillCurve<V> speed = hill_speed(contractile_rate(rate, top, bridges), top);
  return {speed.value, V(speed.slope / (1.0 + bridges.softness * bridges.per_step * speed.slope))};
}

/// Stretch of the cross-bridges at the end of a step [optimal lengths]. @param rate of its end
template <class V>
[[gnu::always_inline]] inline V bridge_stretch(const V& rate, const V& top, const HillBridges<V>& bridges,
                                               const V& step) {
  const V stretch = bridges.stretch + step * (rate - contractile_rate(rate, top, bridges));
  return smaller(greater(stretch, V(0.0 - bridges.softness)), V((hill::kLengthening - 1) * bridges.softness));
}

/// Largest speed of fibres at an activation [optimal lengths/s].
template <class V>
[[gnu::always_inline]] inline V top_speed(const HillConstants<V>& m, const V& activation) {
  return (0.25 + 0.75 * activation) * m.max_speed;
}

template <class V>
struct HillTension {
  V force = 0.0, stiffness = 0.0, damping = 0.0;
};

/// model::tension; with cross-bridges where `kBridged`.
template <bool kBridged = false, class V>
[[gnu::always_inline]] inline HillTension<V> hill_tension(const HillConstants<V>& m, const V& excursion,
                                                          const V& rate, const V& activation,
                                                          const HillBridges<V>& bridges = {}) {
  const HillFibre<V> fibre = hill_fibre(m, excursion);
  const V per = fibre.cosine * m.per_length, x = rate * per, zero = 0.0;
  // Divided: fibres at rest are exactly 1 long, where the passive part has a kink.
  const V l = fibre.length / m.length;
  const HillCurve<V> passive = hill_passive(l);
  // A resting muscle has the passive part alone.
  HillCurve<V> active, speed;
  if (any(activation > zero)) {
    active = hill_active(l);
    const V top = top_speed(m, activation);
    speed = kBridged ? bridged_speed(x, top, bridges) : hill_speed(x, top);
  }
  const V pull = activation * active.value;
  const V drag = passive.value * m.drag;
  const V force = pull * speed.value + passive.value + drag * x;
  const auto pulls = force > zero;
  const V strength = m.force * fibre.cosine, steep = strength * per;
  return {select(pulls, V(strength * force), zero),
          select(pulls, V(steep * (activation * active.slope * speed.value + passive.slope)), zero),
          select(pulls, V(steep * (pull * speed.slope + drag)), zero)};
}

/// model::next_activation.
template <class V>
[[gnu::always_inline]] inline V hill_activation(const V& up, const V& down, const V& activation,
                                                const V& excitation, const V& step) {
  const V slowed = 0.5 + 1.5 * activation;
  const auto rises = excitation > activation;
  const V time = select(rises, V(up * slowed), down), share = select(rises, step, V(step * slowed));
  const V next = (time * activation + share * excitation) / (time + share);
  return smaller(greater(next, V(0.0)), V(1.0));
}

}  // namespace handsim::model
