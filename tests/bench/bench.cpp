// What handsim adds to a bare ODE loop, and what the way from a person to a picture costs. Asserts nothing.
#include <benchmark/benchmark.h>

#include <chrono>

#include <ode/ode.h>

#include "bench/paired.h"
#include "handsim/engine/ode/ode_engine.h"
#include "handsim/model/kinematics.h"
#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::bench {
namespace {

/// A scene's loop without recording against dWorldStep or dWorldQuickStep alone on an identical world. The
/// two hands' tissue has no stiffness, so that its rows need no angle and the bare loop makes the same
/// motion.
void loop_against_bare_ode(benchmark::State& state, const char* name, const char* method) {
  const scene::Scene scene = test::shipped_scene(name, {std::string("solver.method=") + method});
  const model::State start = model::initial_state(scene.model);
  engine::ode::OdeEngine bare(scene.model, scene.spec.solver);
  const bool quick = scene.spec.solver.method() == engine::OdeMethod::quick_step;
  std::unique_ptr<simulation::Simulation> simulation;
  const long steps = simulation::Simulation(scene).step_count();
  compare(
      state, static_cast<double>(steps),
      [&] {
        bare.set_state(start);
        simulation = std::make_unique<simulation::Simulation>(scene);
      },
      [&] {
        for (long i = 0; i < steps; ++i)
          quick ? dWorldQuickStep(bare.world_id(), scene.spec.solver.step)
                : dWorldStep(bare.world_id(), scene.spec.solver.step);
      },
      [&] {
        for (long i = 0; i < steps; ++i) simulation->step();
      });
}
BENCHMARK_CAPTURE(loop_against_bare_ode, two_hands_world_step, "two_hands", "world_step")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(loop_against_bare_ode, two_hands_quick_step, "two_hands", "quick_step")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(loop_against_bare_ode, slider_crank_world_step, "slider_crank_iftomm", "world_step")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(loop_against_bare_ode, slider_crank_quick_step, "slider_crank_iftomm", "quick_step")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

/// A simulation without watchers against its engine alone.
void loop_against_engine(benchmark::State& state, const char* name, const char* solver) {
  const auto scene = std::make_shared<const scene::Scene>(test::shipped_scene(name, {solver}));
  const std::unique_ptr<engine::Engine> bare = engine::make_engine(scene->model, scene->spec.solver);
  simulation::Simulation simulation(scene, simulation::no_watchers);
  const simulation::MotionSnapshot start = simulation.motion();
  const model::State initial = simulation.state();
  compare(
      state, kSteps,
      [&] {
        bare->set_state(initial);
        simulation.reset(start);
      },
      [&] {
        for (int i = 0; i < kSteps; ++i) bare->step({});
      },
      [&] {
        for (int i = 0; i < kSteps; ++i) simulation.step();
      });
}
BENCHMARK_CAPTURE(loop_against_engine, slider_crank_articulated, "slider_crank_iftomm",
                  "solver={engine: articulated, method: semi_implicit_euler, step: 1 ms}")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(loop_against_engine, slider_crank_world_step, "slider_crank_iftomm",
                  "solver={engine: ode, method: world_step, step: 1 ms}")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(loop_against_engine, two_hands_articulated, "two_hands",
                  "solver={engine: articulated, method: semi_implicit_euler, step: 1 ms}")
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

/// Going back to a moment: engine and controller alone against the whole run.
void reset_against_restore(benchmark::State& state, const char* name) {
  const auto scene = std::make_shared<const scene::Scene>(test::shipped_scene(name));
  simulation::Simulation run(scene), motion(scene, simulation::no_watchers);
  for (int i = 0; i < 300; ++i) run.step(), motion.step();
  const simulation::RunSnapshot of_run = run.snapshot();
  const simulation::MotionSnapshot of_motion = motion.motion();
  constexpr int kTimes = 500;
  compare(
      state, static_cast<double>(kTimes), [] {},
      [&] {
        for (int i = 0; i < kTimes; ++i) run.restore(of_run);
      },
      [&] {
        for (int i = 0; i < kTimes; ++i) motion.reset(of_motion);
      });
}
BENCHMARK_CAPTURE(reset_against_restore, slider_crank, "slider_crank_iftomm")->UseManualTime();
BENCHMARK_CAPTURE(reset_against_restore, dropped_hand, "dropped_hand")->UseManualTime();
BENCHMARK_CAPTURE(reset_against_restore, grasp_pinch, "grasp_pinch")->UseManualTime();

/// One controlled hand through its poses: what control costs of the step it drives, from the run's ledger.
void control_share(benchmark::State& state, const char* controller) {
  scene::Scene scene = test::shipped_scene(
      "every_pose",
      {"duration=3",
       "control.controller=" + test::source(std::string("controllers/") + controller + ".yaml").string()});
  // The second hand goes, with all that is its own.
  YamlNode root = scene.resolved;
  root.find("hands")->items.pop_back();
  scene = scene::compile_scene(std::move(root));
  std::vector<double> shares, control;
  for (auto unused : state) {
    (void)unused;
    simulation::Simulation simulation(scene);
    for (long i = 0; i < simulation.step_count(); ++i) simulation.step();
    shares.push_back(simulation.get<simulation::Ledger>().control_share());
    for (const simulation::LedgerEntry& phase : simulation.get<simulation::Ledger>().phases())
      if (phase.name == "control") control.push_back(*phase.ns_per_step);
  }
  state.counters["share"] = median(shares);
  state.counters["control_ns"] = median(control);
}
BENCHMARK_CAPTURE(control_share, implicit, "implicit")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(control_share, explicit, "explicit")->Unit(benchmark::kMillisecond);

/// Both hands of a new person, from the scene's tree in memory to a world that is ready to step. Their hand
/// model has been read before, as in a study that draws persons.
void person_to_world(benchmark::State& state) {
  YamlNode root = test::shipped_scene("two_hands").resolved;
  int person = 0;
  for (auto unused : state) {
    (void)unused;
    const std::string stature = number_text(1.6 + 1e-6 * ++person);
    for (YamlNode& hand : root.find("hands")->items) hand.find("person")->find("stature")->text = stature;
    const scene::Scene scene = scene::compile_scene(root);
    benchmark::DoNotOptimize(engine::make_engine(scene.model, scene.spec.solver));
  }
}
BENCHMARK(person_to_world)->Unit(benchmark::kMicrosecond);

/// One frame of two hands at 1280 x 960, the context's creation included.
void first_frame(benchmark::State& state) {
  const scene::Scene scene = test::shipped_scene("two_hands");
  const simulation::PictureState moment{model::initial_state(scene.model), {}};
  for (auto unused : state) {
    (void)unused;
    benchmark::DoNotOptimize(simulation::draw({scene.model, scene.spec.pictures}, moment));
  }
}
BENCHMARK(first_frame)->Unit(benchmark::kMillisecond)->UseRealTime();

/// Eight frames with one context, per frame, of this width and three quarters of it in height.
void frame(benchmark::State& state) {
  const scene::Scene scene =
      test::shipped_scene("two_hands", {"pictures.size=[" + std::to_string(state.range(0)) + ", " +
                                        std::to_string(state.range(0) * 3 / 4) + "]"});
  const std::vector<simulation::PictureState> moments(8, {model::initial_state(scene.model), {}});
  for (auto unused : state) {
    (void)unused;
    const auto start = std::chrono::steady_clock::now();
    simulation::draw({scene.model, scene.spec.pictures}, moments, {}, {},
                     [](std::size_t, const simulation::Picture& picture) {
                       benchmark::DoNotOptimize(picture.image.rgb.data());
                     });
    state.SetIterationTime(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() /
                           8);
  }
}
BENCHMARK(frame)->Arg(1280)->Arg(640)->Unit(benchmark::kMillisecond)->UseManualTime();

}  // namespace
}  // namespace handsim::bench

BENCHMARK_MAIN();
