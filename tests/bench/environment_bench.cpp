// What environments and batches cost beside the engine that they drive: steps, resets, memory, threads.
#include <benchmark/benchmark.h>
#include <malloc.h>

#include <chrono>

#include "bench/paired.h"
#include "handsim/environment/batch.h"
#include "scene_files.h"

namespace handsim::bench {
namespace {

using environment::Batch;
using environment::BatchSetup;
using environment::Environment;

const std::vector<std::string> kArticulated = {"solver={engine: articulated, step: 1 ms}"};
constexpr int kSubsteps = 10;

/// A batch of one against the bare engine, both without control.
void batch_of_one_against_engine(benchmark::State& state, const char* name) {
  const scene::Scene scene = test::shipped_scene(name, kArticulated);
  const std::unique_ptr<engine::Engine> bare = engine::make_engine(scene.model, scene.spec.solver);
  const model::State initial = bare->state();
  Batch batch(scene, 1);
  compare(
      state, kSteps,
      [&] {
        bare->set_state(initial);
        batch.reset();
      },
      [&] {
        for (int i = 0; i < kSteps; ++i) bare->step({});
      },
      [&] {
        for (int i = 0; i < kSteps; i += kSubsteps) batch.step({}, kSubsteps);
      });
}
BENCHMARK_CAPTURE(batch_of_one_against_engine, two_hands, "two_hands")->UseManualTime();
BENCHMARK_CAPTURE(batch_of_one_against_engine, dropped_hand, "dropped_hand")->UseManualTime();

constexpr std::size_t kBatch = 64;

/// Steps of a scene between which a benchmark steps a batch, over and over.
struct Stretch {
  int first = 0, last = 0;
};

/// A batch that stays within a stretch.
struct Stepped {
  Batch batch;
  Stretch stretch;
  int now = stretch.last;

  /// Untimed.
  void prepare() {
    if (now + kSubsteps <= stretch.last) return;
    batch.reset();
    batch.step({}, now = stretch.first);
  }
  void step() {
    batch.step({}, kSubsteps);
    now += kSubsteps;
  }
  /// Contact points of an environment.
  double contacts() const {
    double sum = 0;
    for (std::size_t i = 0; i < kBatch; ++i)
      sum += static_cast<double>(batch[i].simulation().engine().contacts().size());
    return sum / kBatch;
  }
};

/// All poses; and open hands until they are at rest, which do not touch themselves.
constexpr Stretch kAllPoses = {100, 17000}, kOpen = {100, 1000};
/// From the time when the mug is lifted.
constexpr Stretch kHold = {2000, 5000};
const std::vector<std::string> kSelfContact = {
    "effects=[gravity, joint_stops, passive_tissue, actuation, self_contact]"};

scene::Scene scene_of(const char* name, std::vector<std::string> overrides) {
  overrides.insert(overrides.begin(), kArticulated.begin(), kArticulated.end());
  return test::shipped_scene(name, overrides);
}

/// Steps of a batch in one thread; `hand_steps_per_s` of one core, and the mean of the contact points.
void batch_steps(benchmark::State& state, const char* name, const std::vector<std::string>& overrides,
                 Stretch stretch) {
  const scene::Scene scene = scene_of(name, overrides);
  Stepped stepped{Batch(scene, kBatch, {.threads = 1}), stretch};
  double spent = 0, contacts = 0;
  for (auto unused : state) {
    (void)unused;
    stepped.prepare();
    const double start = cpu_now();
    stepped.step();
    state.SetIterationTime(cpu_now() - start);
    spent += cpu_now() - start;
    contacts += stepped.contacts();
  }
  const double hands = static_cast<double>(scene.model.hands.size() * kBatch * kSubsteps);
  state.counters["hand_steps_per_s"] = hands * static_cast<double>(state.iterations()) / spent;
  state.counters["contacts"] = contacts / static_cast<double>(state.iterations());
}
BENCHMARK_CAPTURE(batch_steps, smooth, "every_pose", std::vector<std::string>{}, kAllPoses)->UseManualTime();
BENCHMARK_CAPTURE(batch_steps, self_contact, "every_pose", kSelfContact, kOpen)->UseManualTime();
BENCHMARK_CAPTURE(batch_steps, self_contact_all_poses, "every_pose", kSelfContact, kAllPoses)
    ->UseManualTime()
    ->Iterations((kAllPoses.last - kAllPoses.first) / kSubsteps);
BENCHMARK_CAPTURE(batch_steps, mug, "grasp_cup", std::vector<std::string>{}, kHold)
    ->UseManualTime()
    ->Iterations((kHold.last - kHold.first) / kSubsteps);

/// The same for a hand that excitations drive. @param strain of its tendons; 0: rigid ones
void muscle_batch_steps(benchmark::State& state, double strain) {
  scene::Scene scene = scene_of("muscle_poses", {"duration=1000"});
  scene.control.reset();
  scene.muscles.reset();
  for (model::Muscle& each : scene.model.muscles)
    if (strain > 0) each.tendon_strain = strain;
  std::vector<double> excitations;
  for (std::size_t i = 0; i < kBatch * scene.model.muscles.size(); ++i)
    excitations.push_back(0.2 * static_cast<double>(i % 7) / 7);
  Batch batch(scene, kBatch, {.threads = 1});
  std::vector<double> times;
  for (auto unused : state) {
    (void)unused;
    const double start = cpu_now();
    batch.step({.excitations = excitations}, kSubsteps);
    times.push_back(cpu_now() - start);
    state.SetIterationTime(times.back());
  }
  state.counters["hand_steps_per_s"] = kBatch * kSubsteps / median(times);
}
BENCHMARK_CAPTURE(muscle_batch_steps, rigid, 0)->UseManualTime();
BENCHMARK_CAPTURE(muscle_batch_steps, elastic, 0.049)->UseManualTime();

/// Two threads against one, by the wall clock.
void two_threads(benchmark::State& state) {
  const scene::Scene scene = test::shipped_scene("every_pose", kArticulated);
  Batch one(scene, 256, {.threads = 1}), two(scene, 256, {.threads = 2});
  const auto wall = [](Batch& batch) {
    const auto start = std::chrono::steady_clock::now();
    batch.step({}, 20);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  std::vector<double> ratios;
  for (auto unused : state) {
    (void)unused;
    ratios.push_back(wall(one) / wall(two));
  }
  state.counters["times_as_fast"] = median(ratios);
}
BENCHMARK(two_threads)->Unit(benchmark::kMillisecond)->UseRealTime();

/// To the scene's start, with numbers drawn: a mass, which changes the model, and gains.
void reset(benchmark::State& state, const char* name, bool drawn) {
  environment::Setup setup;
  if (drawn)
    setup.randomise = {{"objects.0.mass", environment::Distribution::uniform, 0.1, 0.5},
                       {"gains", environment::Distribution::uniform, 0.5, 2}};
  Environment environment(test::shipped_scene(name, kArticulated), setup);
  environment.step({}, 100);
  std::uint64_t seed = 0;
  for (auto unused : state) {
    (void)unused;
    if (drawn)
      environment.reset(++seed);
    else
      environment.reset();
  }
}
BENCHMARK_CAPTURE(reset, every_pose, "every_pose", false)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(reset, grasp_pinch, "grasp_pinch", false)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(reset, grasp_pinch_drawn, "grasp_pinch", true)->Unit(benchmark::kMicrosecond);

/// Memory that an environment of a batch holds after some steps; `kB` of each.
void memory(benchmark::State& state, const char* name) {
  const scene::Scene scene = test::shipped_scene(name, kArticulated);
  constexpr int kCount = 64;
  const std::size_t before = mallinfo2().uordblks;
  Batch batch(scene, kCount, {.threads = 1});
  batch.step({}, 300);
  const std::size_t after = mallinfo2().uordblks;
  for (auto unused : state) (void)unused;
  state.counters["kB"] = 1e-3 * static_cast<double>(after - before) / kCount;
}
BENCHMARK_CAPTURE(memory, every_pose, "every_pose")->Iterations(1);
BENCHMARK_CAPTURE(memory, grasp_pinch, "grasp_pinch")->Iterations(1);
BENCHMARK_CAPTURE(memory, grasp_cup, "grasp_cup")->Iterations(1);

}  // namespace
}  // namespace handsim::bench
