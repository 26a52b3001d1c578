#include "handsim/simulation/run/step_choice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "handsim/scene/read/engine_choice.h"
#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"
#include "handsim/simulation/watch/standard_watchers.h"

namespace handsim::simulation {

namespace {

/// Steps that are tried, the largest first [s].
constexpr std::array kSteps = {4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4};

void set_step(scene::Scene& scene, double step) {
  scene.spec.solver.step = step;
  *value_at(scene.resolved, "solver.step") = yaml_scalar(number_text(step));
}

/// Figures with a limit, of a run to its end; none of a run that diverges.
std::vector<Verdict> judged(scene::Scene scene, double step, const std::function<void()>& poll) {
  set_step(scene, step);
  Simulation simulation(std::make_shared<const scene::Scene>(std::move(scene)), standard_watchers);
  const long steps = simulation.step_count();
  try {
    while (simulation.steps() < steps && !over(simulation, true)) {
      simulation.step();
      if (poll) poll();
    }
  } catch (const Error& error) {
    if (!error.fault()) throw;
    return {};
  }
  std::vector<Verdict> out = simulation.verdicts();
  std::erase_if(out, [](const Verdict& each) { return !each.limit; });
  return out;
}

/// The figure whose verdict a step turns or may turn; empty: there is none.
/// @param runs at the step, at half and at a quarter of it
std::string doubtful(const std::array<std::vector<Verdict>, 3>& runs) {
  for (const auto& run : runs)
    if (run.empty()) return "the motion, which diverged,";
  for (std::size_t i = 0; i < runs[0].size(); ++i) {
    const Verdict& whole = runs[0][i];
    for (std::size_t k = 0; k < 2; ++k) {
      const Verdict &a = runs[k][i], &b = runs[k + 1][i];
      if (a.held() != b.held() || a.missed() != b.missed()) return a.name;
      if (!whole.measured || !a.measured || !b.measured) continue;
      // An error of first order. Written so that NaN is in doubt.
      const double error = std::ldexp(std::abs(*a.measured - *b.measured), static_cast<int>(k) + 1);
      if (!(error <= std::abs(*whole.measured - *whole.limit))) return a.name;
    }
  }
  return {};
}

}  // namespace

scene::Scene with_chosen_step(scene::Scene scene, const std::function<void()>& poll) {
  if (!scene::asks_for_step(scene.resolved)) return scene;
  std::array<std::vector<Verdict>, 3> runs = {
      judged(scene, kSteps[0], poll), judged(scene, kSteps[1], poll), {}};
  std::string why;
  for (std::size_t i = 2; i < kSteps.size(); ++i) {
    runs[2] = judged(scene, kSteps[i], poll);
    if (std::ranges::all_of(runs, [](const auto& run) { return run.empty(); }))
      throw input_error("solver.step", "auto in a scene that no figure judges, or that diverges",
                        "a step, or criteria, by which a step can be judged");
    const std::string turned = doubtful(runs);
    if (turned.empty()) {
      set_step(scene, kSteps[i - 2]);
      scene.spec.step_choice = fmt::format(
          "{:g} ms, the largest whose error turns no verdict, by runs at it, a half and a quarter of "
          "it{}",
          1e3 * kSteps[i - 2], why);
      return scene;
    }
    why = fmt::format("; at {:g} ms {} was in doubt", 1e3 * kSteps[i - 2], turned);
    std::rotate(runs.begin(), runs.begin() + 1, runs.end());
  }
  set_step(scene, kSteps.back());
  scene.spec.step_choice =
      fmt::format("{:g} ms, the smallest that is tried{}, and may be so still", 1e3 * kSteps.back(), why);
  return scene;
}

}  // namespace handsim::simulation
