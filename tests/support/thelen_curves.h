// The curves of Thelen 2003 (the paper of handsim/model/muscle_curves.h) written down again with std::exp: an
// oracle that shares no code with handsim/model.
#pragma once

#include <cmath>
#include <functional>

#include "handsim/model/muscle.h"

namespace handsim::test {

/// A muscle whose tendon is longer than its fibres.
inline model::Muscle long_flexor(double strain) {
  model::Muscle out;
  out.name = "m";
  out.path.arms = {{0, {0.01}, -4, 4}};
  out.force = 200;
  out.fibre_length = 0.07;
  out.slack_length = 0.3;
  out.length = 0.37;
  out.pennation = 0.12;
  out.tendon_strain = strain;
  return out;
}

/// Pull of fibres along the tendon at full width and without speed [N].
inline double fibres_at(const model::Muscle& m, double reach, double activation) {
  const double length = std::hypot(m.fibre_length * std::sin(m.pennation), reach),
               l = length / m.fibre_length;
  const double active = l < 0.2 || l > 1.8 ? 0 : std::exp(-(l - 1) * (l - 1) / 0.45);
  const double over = std::exp(5.0) - 1, grown = std::exp(5 * std::min(l - 1, 0.6) / 0.6);
  const double passive = l <= 1 ? 0 : (grown - 1) / over + 5 / 0.6 * grown / over * std::max(0.0, l - 1.6);
  return m.force * reach / length * (activation * active + passive);
}

/// Tension of a tendon stretched by so much [m].
inline double tendon_at(const model::Muscle& m, double stretch) {
  const double s = stretch / (*m.tendon_strain * m.slack_length), e = std::exp(3.0);
  const double toe = 99 * e / (166 * e - 67);
  if (s <= 0) return 0;
  return m.force *
         (s < toe ? 0.33 * (std::exp(3 * s / toe) - 1) / (e - 1) : 0.33 + 0.67 / (1 - toe) * (s - toe));
}

/// Where an increasing function is zero.
inline double root(double low, double high, const std::function<double(double)>& of) {
  for (int i = 0; i < 100; ++i) (of(0.5 * (low + high)) > 0 ? high : low) = 0.5 * (low + high);
  return 0.5 * (low + high);
}

/// Tension where fibres pull as hard as the tendon, at rest.
inline double resting_tension(const model::Muscle& m, double excursion, double activation) {
  const double taut = m.length - excursion - m.slack_length;
  const double reach =
      root(1e-4, taut, [&](double w) { return fibres_at(m, w, activation) - tendon_at(m, taut - w); });
  return tendon_at(m, taut - reach);
}

}  // namespace handsim::test
