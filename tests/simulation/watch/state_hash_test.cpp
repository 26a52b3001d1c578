#include "handsim/simulation/watch/state_hash.h"

#include <gtest/gtest.h>

#include <cmath>

#include "handsim/core/archive.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::simulation {
namespace {

using test::shipped_scene;

// Oracle: the definition in the header, worked out from the states alone.
TEST(StateHash, IsTheChainOfXxh64OverTheStates) {
  const scene::Scene scene = shipped_scene("slider_crank_iftomm");
  Simulation simulation(scene);
  std::uint64_t chain = 0;
  for (int i = 0; i <= 20; ++i) {
    if (i > 0) simulation.step();
    ArchiveWriter bytes;
    bytes(simulation.state().time);
    for (std::size_t b = 1; b < simulation.state().bodies.size(); ++b) {
      const model::BodyState& body = simulation.state().bodies[b];
      bytes(body.p), bytes(body.q), bytes(body.v), bytes(body.w);
    }
    const std::uint64_t now = hash_bytes(bytes.bytes(), chain);
    EXPECT_EQ(simulation.state_hash(), now) << i;
    if (i % 8 == 0) chain = now;
  }
  // Published test vector of XXH64: no bytes, seed 0.
  EXPECT_EQ(hash_bytes(""), 0xef46db3751d8e999ULL);
}

TEST(StateHash, SeesTheLastBitOfAnyNumber) {
  const scene::Scene scene = shipped_scene("slider_crank_iftomm");
  const model::State state = model::State(Simulation(scene).state());
  const auto hash = [](const model::State& of) {
    StateHash out;
    out.add(of);
    return out.value();
  };
  const auto next = [](double x) { return std::nextafter(x, 1e9); };
  model::State changed = state;
  changed.time = next(changed.time);
  EXPECT_NE(hash(changed), hash(state));
  for (std::size_t b = 1; b < state.bodies.size(); ++b)
    for (int i = 0; i < 3; ++i) {
      changed = state;
      changed.bodies[b].p[i] = next(changed.bodies[b].p[i]);
      EXPECT_NE(hash(changed), hash(state));
      changed = state;
      changed.bodies[b].w[i] = changed.bodies[b].w[i] == 0 ? -0.0 : -changed.bodies[b].w[i];
      EXPECT_NE(hash(changed), hash(state));
      changed = state;
      changed.bodies[b].q.coeffs()[i + 1] = next(changed.bodies[b].q.coeffs()[i + 1]);
      EXPECT_NE(hash(changed), hash(state));
      changed = state;
      changed.bodies[b].v[i] = next(changed.bodies[b].v[i]);
      EXPECT_NE(hash(changed), hash(state));
    }
}

TEST(StateHash, IsReadAndWrittenAsSixteenDigits) {
  EXPECT_EQ(hash_text(0x1f), "000000000000001f");
  EXPECT_EQ(parse_hash("000000000000001f"), 0x1fU);
  for (const char* bad :
       {"", "1f", "000000000000001g", "0x0000000000001f", "-00000000000001f", "0000000000000001f"})
    EXPECT_FALSE(parse_hash(bad)) << bad;
}

}  // namespace
}  // namespace handsim::simulation
