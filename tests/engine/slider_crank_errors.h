// Errors of an engine's slider-crank, compared with its exact reduction to one degree of freedom.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/models.h"
#include "support/slider_crank.h"

namespace handsim::engine::test {

/// Differences from the exact reduction over a run.
struct SliderCrankErrors {
  double velocity = 0;  ///< RMS of the slider's [m/s]
  double position = 0;  ///< largest of the slider's [m]
  double gap = 0;       ///< largest [m]
  double energy = 0;    ///< largest change [J]
};

inline SliderCrankErrors run(const study::SliderCrankSpec& spec, Method method, double step, double duration,
                             double tolerance = 1e-9) {
  const model::Model model = handsim::test::slider_crank(spec);
  Settings with = settings({Effect::gravity}, step, method);
  test::set_tolerance(with, tolerance);
  const auto engine = make_engine(model, with);
  const auto reference = study::SliderCrankReference(spec).series(duration, step);
  std::vector<double> torques(static_cast<std::size_t>(model.dof_count()), 0.0);
  torques[0] = spec.torque;
  const double start = handsim::test::energy(model, engine->state());
  SliderCrankErrors out;
  for (std::size_t i = 1; i < reference.size(); ++i) {
    engine->step({torques});
    const model::BodyState& slider = engine->state().bodies[handsim::test::kSlider];
    out.velocity += std::pow(slider.v.x() - reference[i].vx, 2);
    out.position = std::max(out.position, std::abs(slider.p.x() - reference[i].x));
    out.gap = std::max(out.gap, handsim::test::largest_gap(model, engine->state()));
    const double work = spec.torque * (reference[i].theta - spec.angle);
    out.energy = std::max(out.energy, std::abs(handsim::test::energy(model, engine->state()) - start - work));
  }
  out.velocity = std::sqrt(out.velocity / static_cast<double>(reference.size() - 1));
  return out;
}

}  // namespace handsim::engine::test
