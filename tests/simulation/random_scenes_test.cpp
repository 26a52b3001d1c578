// Whatever valid scene is asked for, it runs or ends in a typed error.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "handsim/simulation/simulation.h"
#include "scene_files.h"
#include "simulation/random_scenes.h"

namespace handsim::simulation {
namespace {

using test::drawn::Drawn;
using test::drawn::random_scene;

struct Count {
  int tried = 0, ran = 0, refused = 0, diverged = 0;
};

TEST(RandomScenes, RunOrEndInATypedError) {
  test::drawn::fix_seed();
  std::map<std::string, Count> counts;
  int unasked = 0, tried = 0;
  const bool held = rc::check("runs or ends in a typed error", [&] {
    const Drawn drawn = random_scene();
    RC_LOG() << drawn.text;
    Count& count = counts[drawn.method];
    ++count.tried, ++tried;
    try {
      const scene::Scene scene =
          scene::compile_scene(parse_yaml(drawn.text, test::source("config/drawn.yaml").string()));
      Simulation simulation(scene);
      for (long i = 0; i < simulation.step_count(); ++i) simulation.step();
      for (const model::BodyState& body : simulation.state().bodies)
        RC_ASSERT(body.p.allFinite() && body.q.coeffs().allFinite() && body.v.allFinite() &&
                  body.w.allFinite());
      RC_ASSERT(!drawn.refused);
      ++count.ran;
    } catch (const Error& error) {
      RC_LOG() << error.what();
      // A fault names what went wrong, an input error where.
      const bool named = error.fault() ? !error.fault()->where.empty() && !error.fault()->quantity.empty()
                                       : !error.problems().empty();
      RC_ASSERT(named);
      if (drawn.refused) RC_ASSERT(!error.fault());
      ++(error.fault() ? count.diverged : count.refused);
      if (!error.fault() && !drawn.refused) ++unasked;
    }
  });
  EXPECT_TRUE(held);
  // The generator means to draw scenes that are valid, and that each method runs.
  EXPECT_LT(unasked, tried / 10 + 1) << tried << " tried";
  for (const auto& [method, count] : counts) {
    EXPECT_GT(count.ran, 0) << method;
    RecordProperty(method, fmt::format("{} tried, {} ran, {} refused, {} diverged", count.tried, count.ran,
                                       count.refused, count.diverged));
  }
  EXPECT_EQ(counts.size(), 9U);
}

}  // namespace
}  // namespace handsim::simulation
