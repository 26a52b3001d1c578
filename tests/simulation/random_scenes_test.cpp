// Whatever valid scene is asked for, it runs or ends in a typed error. The generator draws scenes far from
// sensible: steps of 20 ms, objects of 1 g beside 10 kg, things inside each other, at 20 m/s.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cmath>

#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::simulation {
namespace {

/// Uniform in a range.
double number(double low, double high) {
  constexpr int kParts = 10'000;
  return low + (high - low) * *rc::gen::inRange(0, kParts + 1) / kParts;
}

/// Uniform in its logarithm.
double scale(double low, double high) { return std::exp(number(std::log(low), std::log(high))); }

std::string vector(double size) {
  return fmt::format("[{:.4g}, {:.4g}, {:.4g}]", number(-size, size), number(-size, size),
                     number(-size, size));
}

std::string one_of(std::vector<std::string> words) { return *rc::gen::elementOf(std::move(words)); }

std::string hand(int index) {
  const std::string person = one_of({"child", "giant", "large_man", "small_woman", "median_man"});
  const std::string mount = one_of({"fixed", "free"});
  return fmt::format(
      "{{model: {}, person: {}, side: {}, wrist: {{mount: {}, position: [{:.3g}, 0, {:.3g}], rotation: "
      "{{axis: [{:.3g}, 1, "
      "{:.3g}], angle: {:.3g}}}}}}}",
      test::source("handmodels/" + one_of({"anatomical", "prototype"}) + ".yaml").string(),
      test::source("config/persons/" + person + ".yaml").string(), one_of({"right", "left"}), mount,
      0.15 * index + number(-0.05, 0.05), number(0, 0.3), number(-1, 1), number(-1, 1), number(-3, 3));
}

std::string object(int index) {
  const std::string shape = one_of({"sphere", "box", "cylinder", "capsule"});
  std::string size;
  if (shape == "sphere")
    size = fmt::format("radius: {:.4g}", scale(3e-3, 0.1));
  else if (shape == "box")
    size =
        fmt::format("edges: [{:.4g}, {:.4g}, {:.4g}]", scale(5e-3, 0.2), scale(5e-3, 0.2), scale(5e-3, 0.2));
  else
    size = fmt::format("radius: {:.4g}, length: {:.4g}", scale(3e-3, 0.05), scale(5e-3, 0.2));
  return fmt::format(
      "{{name: thing{}, shape: {}, {}, mass: {:.4g}, position: {}, velocity: {}, restitution: {:.2g}, "
      "friction: "
      "{:.3g}, overlap: allowed}}",
      index, shape, size, scale(1e-3, 10), vector(0.2), vector(scale(0.01, 20)), number(0, 1), number(0, 3));
}

template <class Make>
std::string list(int least, int most, Make make) {
  std::string out;
  for (int i = *rc::gen::inRange(least, most + 1); i > 0; --i) out += (out.empty() ? "" : ", ") + make(i);
  return "[" + out + "]";
}

std::string random_scene() {
  return fmt::format(
      "title: drawn\nhands: {}\nobjects: {}\n{}effects: auto\n"
      "solver: {{engine: ode, method: {}, step: {:.4g}, erp: {:.3g}, cfm: {:.3g}, iterations: {}, "
      "projection: {}, "
      "seed: {}}}\nduration: 0.1\n",
      list(0, 2, hand), list(1, 3, object), *rc::gen::arbitrary<bool>() ? "ground: {height: -0.1}\n" : "",
      one_of({"world_step", "quick_step", "auto"}), scale(5e-4, 0.02), number(0, 1), scale(1e-10, 1e-3),
      *rc::gen::inRange(1, 100), one_of({"false", "false", "true"}), *rc::gen::inRange(0, 1000));
}

TEST(RandomScenes, RunOrEndInATypedError) {
  int tried = 0, refused = 0, diverged = 0;
  const bool held = rc::check("runs or ends in a typed error", [&] {
    const std::string text = random_scene();
    ++tried;
    try {
      const scene::Scene scene =
          scene::compile_scene(parse_yaml(text, test::source("config/drawn.yaml").string()));
      Simulation simulation(scene);
      for (long i = 0; i < simulation.step_count(); ++i) simulation.step();
      for (const model::BodyState& body : simulation.state().bodies)
        RC_ASSERT(body.p.allFinite() && body.q.coeffs().allFinite() && body.v.allFinite() &&
                  body.w.allFinite());
    } catch (const Error& error) {
      // A fault names what went wrong, an input error where.
      const bool named = error.fault() ? !error.fault()->where.empty() && !error.fault()->quantity.empty()
                                       : !error.problems().empty();
      RC_ASSERT(named);
      ++(error.fault() ? diverged : refused);
    }
  });
  EXPECT_TRUE(held);
  // The generator means to draw scenes that are valid.
  EXPECT_LT(refused, tried / 10 + 1) << tried << " tried";
  RecordProperty("tried", tried);
  RecordProperty("diverged", diverged);
}

}  // namespace
}  // namespace handsim::simulation
