// What a step of the articulated engine costs against a bare ODE loop on the same hand. Asserts nothing.
#include <benchmark/benchmark.h>

#include <ode/ode.h>
#ifdef HANDSIM_WITH_MUJOCO
#include <mujoco/mujoco.h>
#include <unistd.h>

#include <fstream>

#include "handsim/output/mjcf.h"
#endif

#include "bench/paired.h"
#include "handsim/engine/articulated/articulated_engine.h"
#include "handsim/engine/ode/ode_engine.h"
#include "handsim/model/kinematics.h"
#include "scene_files.h"

namespace handsim::bench {
namespace {

constexpr int kSteps = 2000;

/// One anatomical hand on a still palm under gravity, with stops, tissue and a servo on every
/// coordinate, its error changing as a controller's does.
struct Load {
  scene::Scene scene;
  std::vector<std::vector<model::Servo>> servos;  ///< taken in turns
};

constexpr int kTurns = 64;

Load one_hand() {
  Load out;
  out.scene = test::shipped_scene("two_hands", {});
  YamlNode root = out.scene.resolved;
  root.find("hands")->items.pop_back();
  out.scene = scene::compile_scene(std::move(root));
  out.scene.spec.solver.effects.add(model::Effect::actuation);
  const auto dofs = static_cast<std::size_t>(out.scene.model.dof_count());
  for (int turn = 0; turn < kTurns; ++turn) {
    out.servos.emplace_back(dofs);
    for (std::size_t i = 0; i < dofs; ++i)
      out.servos.back()[i] = {0.05, 1e-3, 0.02 * std::sin(0.1 * turn + static_cast<double>(i)), 0, 0.5};
  }
  return out;
}

/// Candidate: the engine's whole step, servos set each time. Yardstick: dWorldStep alone on the same hand,
/// its servos set once.
void step_against_bare_ode(benchmark::State& state, int width) {
  const Load load = one_hand();
  const model::State start = model::initial_state(load.scene.model);
  engine::ode::OdeEngine bare(load.scene.model, load.scene.spec.solver);
  engine::Settings settings = load.scene.spec.solver;
  settings.method = engine::Method::semi_implicit_euler;
  const engine::articulated::Kernel* kernel = nullptr;
  for (const engine::articulated::Kernel* each : engine::articulated::kernels())
    if (each->width == width) kernel = each;
  if (width > 0 && !kernel) return state.SkipWithError("not on this processor");
  engine::articulated::ArticulatedEngine engine(load.scene.model, settings, kernel);
  compare(
      state, kSteps,
      [&] {
        bare.set_state(start);
        engine.set_state(start);
        bare.step({.servos = load.servos[0]});
      },
      [&] {
        for (int i = 0; i < kSteps; ++i) dWorldStep(bare.world_id(), settings.step);
      },
      [&] {
        for (std::size_t i = 0; i < kSteps; ++i) engine.step({.servos = load.servos[i % kTurns]});
      });
  state.SetLabel(engine.version());
}
BENCHMARK_CAPTURE(step_against_bare_ode, chosen, 0)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(step_against_bare_ode, one_lane, 1)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(step_against_bare_ode, two_lanes, 2)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(step_against_bare_ode, four_lanes, 4)->UseManualTime()->Unit(benchmark::kMillisecond);

#ifdef HANDSIM_WITH_MUJOCO
/// Yardstick: mj_step of MuJoCo with its Euler method on the exported hand, stops on, no contact tested, the
/// same spring-dampers by its motors.
void step_against_mujoco(benchmark::State& state) {
  const Load load = one_hand();
  const std::string path = "/tmp/handsim_bench_" + std::to_string(getpid()) + ".xml";
  std::ofstream(path) << output::to_mjcf(load.scene.model, load.scene.spec.solver);
  char error[1000] = {};
  mjModel* other = mj_loadXML(path.c_str(), nullptr, error, sizeof error);
  std::filesystem::remove(path);
  if (!other) return state.SkipWithError(error);
  other->opt.disableflags |= mjDSBL_CONTACT;
  // The servos' damping as the joints' own, which MuJoCo solves implicitly, as the engine does.
  for (int k = 0; k < other->nv; ++k)
    other->dof_damping[k] += load.servos[0][static_cast<std::size_t>(k)].damping;
  mjData* data = mj_makeData(other);
  engine::Settings settings = load.scene.spec.solver;
  settings.method = engine::Method::semi_implicit_euler;
  engine::articulated::ArticulatedEngine engine(load.scene.model, settings);
  const model::State start = model::initial_state(load.scene.model);
  compare(
      state, kSteps,
      [&] {
        mj_resetDataKeyframe(other, data, 0);
        engine.set_state(start);
      },
      [&] {
        for (std::size_t i = 0; i < kSteps; ++i) {
          for (int k = 0; k < other->nu; ++k) {
            const model::Servo& servo = load.servos[i % kTurns][static_cast<std::size_t>(k)];
            data->ctrl[k] = servo.stiffness * servo.error;
          }
          mj_step(other, data);
        }
      },
      [&] {
        for (std::size_t i = 0; i < kSteps; ++i) engine.step({.servos = load.servos[i % kTurns]});
      });
  state.SetLabel(engine.version() + " against MuJoCo " + mj_versionString());
  mj_deleteData(data);
  mj_deleteModel(other);
}
BENCHMARK(step_against_mujoco)->UseManualTime()->Unit(benchmark::kMillisecond);
#endif

/// The poses of all bodies out of the joint coordinates.
void read_state(benchmark::State& state) {
  const Load load = one_hand();
  engine::Settings settings = load.scene.spec.solver;
  settings.method = engine::Method::semi_implicit_euler;
  engine::articulated::ArticulatedEngine engine(load.scene.model, settings);
  model::State out = engine.state();
  for (auto unused : state) {
    (void)unused;
    engine.mechanism().give(out);
    benchmark::DoNotOptimize(out.bodies.data());
  }
}
BENCHMARK(read_state);

}  // namespace
}  // namespace handsim::bench
