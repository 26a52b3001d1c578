// A batch does what its environments do alone, to the bit, however it is split.
#include "handsim/environment/batch.h"

#include <gtest/gtest.h>
#include <malloc.h>

#include <numeric>

#include <tbb/global_control.h>

#include "handsim/engine/articulated/articulated_engine.h"
#include "scene_files.h"
#include "support/sanitized.h"
#include "support/state_bits.h"

namespace handsim::environment {
namespace {

using test::bits;
using test::shipped_scene;

/// Torques that differ from environment to environment and step to step.
std::vector<double> torques(const Batch& batch, std::size_t first, int step) {
  const auto dofs = static_cast<std::size_t>(batch[0].scene().model.dof_count());
  std::vector<double> out(batch.size() * dofs);
  for (std::size_t i = 0; i < batch.size(); ++i)
    for (std::size_t k = 0; k < dofs; ++k)
      out[i * dofs + k] = 1e-3 * std::sin(0.1 * step + static_cast<double>((first + i) * dofs + k));
  return out;
}

/// Last bits of 64 environments stepped in batches of a size.
std::vector<std::uint64_t> run(const scene::Scene& scene, std::size_t size, int threads, int steps) {
  std::vector<std::uint64_t> out;
  for (std::size_t first = 0; first < 64; first += size) {
    const std::size_t count = std::min(size, 64 - first);
    environment::Setup setup;
    setup.randomise = {{"q", Distribution::uniform, 0.0, 0.05}};
    Batch batch(scene, count, {setup, nullptr, threads});
    std::vector<std::uint64_t> seeds(count);
    std::iota(seeds.begin(), seeds.end(), first);
    batch.reset(seeds);
    for (int i = 0; i < steps; ++i) batch.step({.torques = torques(batch, first, i)}, 2);
    for (std::size_t i = 0; i < count; ++i) out.push_back(bits(batch[i]));
  }
  return out;
}

class OnScene : public testing::TestWithParam<std::pair<const char*, const char*>> {};
INSTANTIATE_TEST_SUITE_P(
    Scenes, OnScene,
    testing::Values(std::pair{"two_hands", "articulated"}, std::pair{"dropped_hand", "articulated"},
                    std::pair{"every_pose", "articulated"}, std::pair{"pose_tracking", "articulated"},
                    std::pair{"dropped_hand", "ode"}),
    [](const auto& scene) { return std::string(scene.param.first) + "_" + scene.param.second; });

TEST_P(OnScene, TheBitsAreThoseOfEveryBatchSizeAndNumberOfThreads) {
  const scene::Scene scene = shipped_scene(
      GetParam().first, {std::string("solver={engine: ") + GetParam().second + ", step: 1 ms}"});
  // TBB starts no more threads than there are cores without this.
  const tbb::global_control eight(tbb::global_control::max_allowed_parallelism, 8);
  const int steps = GetParam().second == std::string("ode") ? 40 : 90;
  const std::vector<std::uint64_t> alone = run(scene, 1, 1, steps);
  EXPECT_NE(alone[0], alone[1]);
  using Sizes = std::vector<std::pair<std::size_t, int>>;
  for (const auto& [size, threads] :
       test::kSanitized ? Sizes{{64, 8}, {7, 2}} : Sizes{{64, 1}, {64, 2}, {64, 8}, {7, 2}, {7, 8}, {9, 1}})
    EXPECT_EQ(run(scene, size, threads, steps), alone) << size << " in " << threads << " threads";
}

/// Seeds that differ from environment to environment.
std::vector<std::uint64_t> seeds_of(const Batch& batch, std::uint64_t first) {
  std::vector<std::uint64_t> out(batch.size());
  std::iota(out.begin(), out.end(), first);
  return out;
}

class WithDrawnNumbers : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Effects, WithDrawnNumbers,
                         testing::Values("[gravity, joint_stops, passive_tissue, actuation]",
                                         "[gravity, joint_stops, passive_tissue, actuation, self_contact]",
                                         "[gravity, actuation]"));

// Oracle: environments alone with the same seeds and actions. What engines and controllers keep is the same.
TEST_P(WithDrawnNumbers, EachEnvironmentIsTheOneAlone) {
  const scene::Scene scene = shipped_scene(
      "every_pose", {"solver={engine: articulated, step: 1 ms}", std::string("effects=") + GetParam()});
  environment::Setup setup;
  setup.randomise = {{"q", Distribution::uniform, 0.0, 0.3},
                     {"gravity", Distribution::uniform, -9, 9},
                     {"gains", Distribution::log_uniform, 0.5, 2},
                     {"torque_limits", Distribution::log_uniform, 0.02, 1}};
  Batch batch(scene, 13, {setup, nullptr, 2});
  std::vector<Environment> alone;
  for (std::size_t i = 0; i < batch.size(); ++i) alone.emplace_back(scene, setup);
  std::vector<std::uint64_t> seeds = seeds_of(batch, 5);
  batch.reset(seeds);
  for (std::size_t i = 0; i < batch.size(); ++i) alone[i].reset(seeds[i]);
  const std::size_t axes = batch[0].simulation().controller()->axes().size();
  const auto dofs = static_cast<std::size_t>(scene.model.dof_count());
  std::vector<double> angles(batch.size() * axes);
  for (int call = 0; call < 60; ++call) {
    for (std::size_t i = 0; i < angles.size(); ++i)
      angles[i] = 0.3 * std::sin(static_cast<double>(i) + 0.2 * call);
    const std::vector<double> all = torques(batch, 0, call);
    const bool pushes = call % 2 == 0, holds = call % 3 == 0;
    batch.step(
        {.torques = pushes ? all : std::vector<double>(), .angles = holds ? angles : std::vector<double>()},
        1 + call % 4);
    for (std::size_t i = 0; i < batch.size(); ++i) {
      const std::span<const double> own = std::span(all).subspan(i * dofs, pushes ? dofs : 0),
                                    held = std::span(angles).subspan(i * axes, holds ? axes : 0);
      alone[i].step({.torques = own, .angles = held}, 1 + call % 4);
    }
    // Some are behind the others from here on.
    if (call != 20) continue;
    std::vector<unsigned char> mask(batch.size());
    mask[3] = mask[7] = 1;
    seeds[3] = 100;
    batch.reset(seeds, mask);
    for (const std::size_t i : {std::size_t{3}, std::size_t{7}}) alone[i].reset(seeds[i]);
  }
  EXPECT_NE(bits(batch[0]), bits(batch[1]));
  for (std::size_t i = 0; i < batch.size(); ++i) {
    EXPECT_EQ(bits(batch[i]), bits(alone[i])) << i;
    EXPECT_EQ(batch[i].simulation().snapshot().bytes, alone[i].simulation().snapshot().bytes) << i;
  }
}

// Oracle: one lane. Wider kernels have nodes with and without a body side by side, and a limit of fast
// rotation took the spin of both.
TEST(Kernels, GiveASwingingHandTheSameBitsAtEveryWidth) {
  const scene::Scene scene =
      shipped_scene("stability/swinging_prototype", {"solver={engine: articulated, step: 1 ms}"});
  std::vector<std::uint64_t> ends;
  for (const engine::articulated::Kernel* kernel : engine::articulated::kernels()) {
    engine::articulated::ArticulatedEngine engine(scene.model, scene.spec.solver, kernel);
    for (int i = 0; i < 200; ++i) engine.step({});
    ends.push_back(bits(engine.state()));
  }
  for (const std::uint64_t end : ends) EXPECT_EQ(end, ends[0]);
}

TEST(Batch, IsTheSimulationOfTheScene) {
  const scene::Scene scene = shipped_scene("dropped_hand", {"solver={engine: articulated, step: 1 ms}"});
  simulation::Simulation simulation(scene, simulation::no_watchers);
  Batch batch(scene, 9);
  for (int i = 0; i < 400; ++i) simulation.step();
  batch.step({}, 400);
  for (std::size_t i = 0; i < batch.size(); ++i) EXPECT_EQ(bits(batch[i]), bits(simulation.state()));
}

// Oracle: an environment that shares its scene with none.
TEST(Batch, ANumberThatOneEnvironmentSetsIsNotThatOfTheOthers) {
  const scene::Scene scene = shipped_scene("every_pose", {"solver={engine: articulated, step: 1 ms}"});
  Batch batch(scene, 9);
  Environment alone(scene);
  batch[2].set("gravity", std::vector<double>{0, 0, -3});
  batch[2].set("gains", std::vector<double>{0.5});
  alone.set("gravity", std::vector<double>{0, 0, -3});
  alone.set("gains", std::vector<double>{0.5});
  EXPECT_EQ(batch[2].get("gravity")[2], -3);
  EXPECT_EQ(batch[3].get("gravity")[2], scene.model.gravity.z());
  batch.reset();
  alone.reset();
  batch.step({}, 40);
  alone.step({}, 40);
  EXPECT_EQ(bits(batch[2]), bits(alone));
  EXPECT_NE(bits(batch[3]), bits(alone));
  alone = Environment(scene);
  alone.step({}, 40);
  EXPECT_EQ(bits(batch[3]), bits(alone));
}

// Oracle: the allocator's own count of what is in use. What a thread has once is shared by 128 environments.
TEST(Batch, AnEnvironmentThatTouchesHoldsLessThan200Kilobytes) {
  const auto in_use = [] {
    const auto now = mallinfo2();
    return static_cast<double>(now.uordblks + now.hblkhd);
  };
  // An allocator of another kind, such as the address sanitizer's, tells nothing.
  const double before = in_use();
  if (const std::vector<double> block(1'000'000); !(in_use() - before > 7e6 && block[0] == 0))
    GTEST_SKIP() << "the allocator does not count";
  for (const char* name : {"grasp_pinch", "grasp_cup", "every_pose"}) {
    const scene::Scene scene = test::shipped_scene(name, {"solver={engine: articulated, step: 1 ms}"});
    const double start = in_use();
    Batch batch(scene, 128, {.threads = 1});
    batch.step({}, 300);
    EXPECT_LT(in_use() - start, 128 * 200e3) << name;
    EXPECT_GT(in_use() - start, 128 * 50e3) << name;
  }
}

TEST(Batch, EndsThoseThatAreDoneAndLetsOthersGoOn) {
  const scene::Scene scene = shipped_scene("dropped_hand", {"solver={engine: articulated, step: 1 ms}"});
  BatchSetup setup;
  setup.environment.randomise = {{"objects.0.position", Distribution::uniform, 0.4, 0.8}};
  const auto height = [](const Environment& of) {
    return of.simulation().state().bodies[of.scene().model.bodies.size() - 2].p.z();
  };
  setup.done = [&](const Environment& of) { return height(of) < 0.35; };
  Batch batch(scene, 16, setup);
  std::vector<std::uint64_t> seeds(16);
  std::iota(seeds.begin(), seeds.end(), 0);
  batch.reset(seeds);
  std::vector<double> start(16);
  for (std::size_t i = 0; i < 16; ++i) start[i] = height(batch[i]);
  for (int i = 0; i < 200; ++i) batch.step();
  int done = 0;
  for (std::size_t i = 0; i < 16; ++i) {
    // Oracle: free fall, semi-implicit: z = z0 - g h^2 n (n + 1) / 2.
    const double n = static_cast<double>(batch[i].steps());
    EXPECT_NEAR(height(batch[i]), start[i] - 9.80665e-6 * n * (n + 1) / 2, 1e-9);
    EXPECT_EQ(batch.done()[i] != 0, height(batch[i]) < 0.35);
    done += batch.done()[i];
  }
  EXPECT_GT(done, 0);
  EXPECT_LT(done, 16);
  std::vector<unsigned char> mask(batch.done().begin(), batch.done().end());
  const long other =
      batch[static_cast<std::size_t>(std::find(mask.begin(), mask.end(), 0) - mask.begin())].steps();
  batch.reset({}, mask);
  EXPECT_EQ(std::count(batch.done().begin(), batch.done().end(), 0), 16);
  EXPECT_EQ(other, 200);
}

TEST(Batch, GoesOnWithoutTheOneThatDiverges) {
  const scene::Scene scene = shipped_scene("dropped_hand", {"solver={engine: articulated, step: 1 ms}"});
  Batch batch(scene, 9), calm(scene, 9);
  std::vector<std::vector<engine::BodyForce>> forces(9);
  forces[4] = {{1, Vec3(1e6, 0, 0), Vec3::Zero()}};
  for (int i = 0; i < 20; ++i) batch.step({.forces = forces}, 10);
  calm.step({}, 200);
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(batch.failed()[i] != 0, i == 4);
    if (i != 4) {
      EXPECT_EQ(bits(batch[i]), bits(calm[i]));
    }
  }
  ASSERT_NE(batch[4].failure(), nullptr);
  batch.reset();
  calm.reset();
  batch.step({}, 50);
  calm.step({}, 50);
  EXPECT_EQ(bits(batch[4]), bits(calm[4]));
  // What is wrong with an action is an error that names it.
  const std::vector<double> few(5);
  EXPECT_THROW(batch.step({.torques = few}), Error);
}

TEST(Batch, GivesObservationsRowByRow) {
  const scene::Scene scene = shipped_scene("two_hands", {"solver={engine: articulated, step: 1 ms}"});
  BatchSetup setup;
  setup.environment.observe = {"u", "q", "time"};
  Batch batch(scene, 10, setup);
  batch.step({}, 5);
  const std::size_t width = batch.observation_size();
  ASSERT_EQ(batch.observations().size(), 10 * width);
  for (std::size_t i = 0; i < 10; ++i) {
    const model::State& state = batch[i].simulation().state();
    const auto row = batch.observations().subspan(i * width, width);
    EXPECT_TRUE(std::equal(state.u.begin(), state.u.end(), row.begin()));
    EXPECT_TRUE(std::equal(state.q.begin(), state.q.end(),
                           row.begin() + static_cast<std::ptrdiff_t>(state.u.size())));
    EXPECT_EQ(row.back(), state.time);
  }
}

}  // namespace
}  // namespace handsim::environment
