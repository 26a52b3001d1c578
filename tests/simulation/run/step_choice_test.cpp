#include "handsim/simulation/run/step_choice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "handsim/core/error.h"
#include "handsim/scene/read/engine_choice.h"
#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::simulation {
namespace {

/// A ball that falls on a pad; its greatest depth is off by the step.
scene::Scene ball_on_pad(const std::string& step, const std::string& criteria) {
  return scene::compile_scene(
      parse_yaml("objects: [{name: ball, shape: sphere, radius: 0.02, mass: 0.1, position: [0, 0, 0.0303]}]\n"
                 "ground: {height: 0}\n"
                 "contacts: {materials: [{name: pad, friction: 0.5, stiffness: 1000, damping: 1}],\n"
                 "           rules: [{between: [objects, ground], material: pad}]}\n"
                 "solver: {engine: articulated, step: " +
                     step +
                     "}\n"
                     "duration: 0.2\n" +
                     criteria,
                 "ball.yaml"));
}

scene::Scene with_limit(const std::string& step, double limit) {
  return ball_on_pad(step, fmt::format("criteria: {{penetration: {}}}\n", limit));
}

double depth_at(double step) {
  Simulation simulation(with_limit(fmt::format("{}", step), 0.1));
  for (long i = 0; i < simulation.step_count(); ++i) simulation.step();
  for (const Verdict& verdict : simulation.verdicts())
    if (verdict.name == "penetration") return verdict.measured.value_or(NAN);
  return NAN;
}

// Oracle: depths of runs at each step. The step chosen is the largest at which twice the difference of it and
// half of it, and four times that of a half and a quarter, are less than what is left to the limit; and the
// verdict there is that of 1/64 ms.
TEST(StepChoice, IsTheLargestStepWhoseErrorIsLessThanWhatIsLeftToTheLimit) {
  const double exact = depth_at(1e-3 / 64);
  std::vector<double> chosen;
  for (const double share : {0.9, 0.999, 1.001, 1.1, 1.5}) {
    const double limit = share * exact;
    double expected = 1.25e-4;
    for (const double step : {5e-4, 1e-3, 2e-3, 4e-3}) {
      const double whole = depth_at(step), half = depth_at(step / 2), quarter = depth_at(step / 4);
      const double error = std::max(2 * std::abs(whole - half), 4 * std::abs(half - quarter));
      if ((whole <= limit) == (half <= limit) && (half <= limit) == (quarter <= limit) &&
          error <= std::abs(whole - limit))
        expected = step;
    }
    const scene::Scene found = with_chosen_step(with_limit("auto", limit));
    EXPECT_EQ(found.spec.solver.step, expected) << share;
    EXPECT_EQ(depth_at(expected) <= limit, exact <= limit) << share;
    EXPECT_FALSE(scene::asks_for_step(found.resolved));
    EXPECT_EQ(found.spec.step_choice.find(fmt::format("{:g} ms", 1e3 * expected)), 0U)
        << found.spec.step_choice;
    chosen.push_back(expected);
  }
  // The nearer the limit, the smaller the step.
  EXPECT_LT(chosen[1], chosen[0]);
  EXPECT_LT(chosen[0], chosen[4]);
}

// Oracle: the summary's step and reason, and resolved.yaml, whose run has the same states.
TEST(StepChoice, IsToldAndRepeated) {
  const test::TemporaryFolder first, second;
  RunOptions options;
  options.out = first.path();
  const RunResult result = run(with_chosen_step(with_limit("auto", 0.02)), options);
  const auto summary = nlohmann::json::parse(result.summary);
  EXPECT_TRUE(summary.contains("step_choice"));
  options.out = second.path();
  const RunResult again = run(scene::load_scene(first.path() / "resolved.yaml"), options);
  EXPECT_EQ(result.state_hash, again.state_hash);
  EXPECT_EQ(summary["solver"]["step_s"], nlohmann::json::parse(again.summary)["solver"]["step_s"]);
}

// Oracle: the contract: a step that is named stays, and nothing runs at a step that nobody chose.
TEST(StepChoice, IsAskedForAndNeverSilent) {
  const scene::Scene named = with_chosen_step(with_limit("0.003", 0.1));
  EXPECT_EQ(named.spec.solver.step, 0.003);
  EXPECT_TRUE(named.spec.step_choice.empty());
  EXPECT_THROW(Simulation(with_limit("auto", 0.1)), Error);
  EXPECT_THROW(with_chosen_step(ball_on_pad("auto", "")), Error);
}

}  // namespace
}  // namespace handsim::simulation
