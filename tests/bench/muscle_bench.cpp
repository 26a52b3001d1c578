// What muscles and bands add to a step of the articulated engine. Asserts nothing.
#include <benchmark/benchmark.h>

#include "bench/one_hand.h"
#include "bench/paired.h"
#include "handsim/engine/articulated/articulated_engine.h"
#include "handsim/model/kinematics.h"

namespace handsim::bench {
namespace {

/// Yardstick: the step of the same hand without these effects. Candidate: with them; excitations of 0 to 1
/// that change in every step, or none.
/// @param strain of elastic tendons, @param short_range stiffness of the fibres
void step_with_muscles(benchmark::State& state, const std::string& effects, bool excited,
                       std::optional<double> strain = {}, std::optional<double> short_range = {}) {
  Load load = one_hand(false, effects);
  for (model::Muscle& each : load.scene.model.muscles) {
    each.tendon_strain = strain;
    each.short_range = short_range;
  }
  const model::Model& model = load.scene.model;
  engine::Settings settings = load.scene.spec.solver;
  settings.use(engine::ArticulatedMethod::semi_implicit_euler);
  engine::articulated::ArticulatedEngine with(model, settings);
  settings.effects.remove(model::Effect::muscles);
  settings.effects.remove(model::Effect::tendon_coupling);
  engine::articulated::ArticulatedEngine without(model, settings);
  std::vector<std::vector<double>> excitations(kTurns);
  for (std::size_t turn = 0; turn < kTurns && excited; ++turn)
    for (std::size_t m = 0; m < model.muscles.size(); ++m)
      excitations[turn].push_back(0.5 +
                                  0.5 * std::sin(0.1 * static_cast<double>(turn) + static_cast<double>(m)));
  const model::State start = model::initial_state(model);
  compare(
      state, kSteps,
      [&] {
        without.set_state(start);
        with.set_state(start);
      },
      [&] {
        for (std::size_t i = 0; i < kSteps; ++i) without.step({.servos = load.servos[i % kTurns]});
      },
      [&] {
        for (std::size_t i = 0; i < kSteps; ++i) {
          engine::StepInput input;
          input.servos = load.servos[i % kTurns];
          input.excitations = excitations[i % kTurns];
          with.step(input);
        }
      });
  state.counters["added_us"] = state.counters["candidate_us"] - state.counters["yardstick_us"];
  state.SetLabel(with.version());
}
BENCHMARK_CAPTURE(step_with_muscles, excited, ", muscles, tendon_coupling", true)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(step_with_muscles, elastic, ", muscles, tendon_coupling", true, 0.049)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(step_with_muscles, short_range, ", muscles, tendon_coupling", true, std::nullopt, 23.4)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(step_with_muscles, short_range_elastic, ", muscles, tendon_coupling", true, 0.049, 23.4)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(step_with_muscles, at_rest, ", muscles, tendon_coupling", false)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(step_with_muscles, bands_alone, ", tendon_coupling", false)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace handsim::bench
