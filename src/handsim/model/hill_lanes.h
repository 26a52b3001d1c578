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

template <class V>
struct HillTension {
  V force = 0.0, stiffness = 0.0, damping = 0.0;
};

/// model::tension.
template <class V>
[[gnu::always_inline]] inline HillTension<V> hill_tension(const HillConstants<V>& m, const V& excursion,
                                                          const V& rate, const V& activation) {
  const HillFibre<V> fibre = hill_fibre(m, excursion);
  const V per = fibre.cosine * m.per_length, x = rate * per, zero = 0.0;
  // Divided: fibres at rest are exactly 1 long, where the passive part has a kink.
  const V l = fibre.length / m.length;
  const HillCurve<V> passive = hill_passive(l);
  // A resting muscle has the passive part alone.
  HillCurve<V> active, speed;
  if (any(activation > zero)) {
    active = hill_active(l);
    speed = hill_speed(x, V((0.25 + 0.75 * activation) * m.max_speed));
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
