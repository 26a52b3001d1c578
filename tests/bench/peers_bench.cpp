// What peers need for work that bench_handsim does not compare: a hand from its file, many hands at once, and
// Pinocchio's algorithms for smooth motion. Asserts nothing.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <stdexcept>

#include "bench/one_hand.h"
#include "bench/paired.h"
#ifdef HANDSIM_WITH_PINOCCHIO
#include "bench/pinocchio_calls.h"
#include "support/written.h"
#endif
#include "handsim/engine/articulated/articulated_engine.h"
#include "handsim/environment/batch.h"
#include "handsim/model/kinematics.h"
#if defined(HANDSIM_WITH_MUJOCO) && mjVERSION_HEADER >= 4000000
#include <mujoco/mjbatch.h>
#endif

namespace handsim::bench {
namespace {

engine::Settings smooth(const scene::Scene& scene) {
  engine::Settings settings = scene.spec.solver;
  settings.use(engine::ArticulatedMethod::semi_implicit_euler);
  return settings;
}

#ifdef HANDSIM_WITH_MUJOCO
/// One hand from its description in memory to an engine that is ready to step: a person's YAML here, the MJCF
/// that is exported of it there (the yardstick).
void hand_to_engine(benchmark::State& state) {
  const Load load = one_hand();
  const std::string text = test::written("mjcf", load.scene.model, load.scene.spec.solver);
  compare(
      state, 1, [] {},
      [&] {
        const auto model = mujoco::compile(text);
        const std::unique_ptr<mjData, mujoco::Free> data(mj_makeData(model.get()));
        benchmark::DoNotOptimize(data.get());
      },
      [&] {
        const scene::Scene scene = scene::compile_scene(load.scene.resolved);
        const engine::articulated::ArticulatedEngine engine(scene.model, smooth(scene));
        benchmark::DoNotOptimize(&engine);
      });
  state.SetLabel(std::string("MuJoCo ") + mj_versionString());
}
BENCHMARK(hand_to_engine)->UseManualTime()->Unit(benchmark::kMicrosecond);

#if mjVERSION_HEADER >= 4000000
constexpr int kHands = 1024, kThreads = 2;
constexpr double kTarget = 0.2;  // [rad], of every axis

double wall(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// One hand with stops, tissue and control of all joints.
scene::Scene controlled_hand(bool self_contact) {
  const std::string effects = "effects=[gravity, joint_stops, passive_tissue, actuation";
  YamlNode root = test::shipped_scene("every_pose", {"solver={engine: articulated, step: 1 ms}",
                                                     effects + (self_contact ? ", self_contact]" : "]")})
                      .resolved;
  root.find("hands")->items.pop_back();
  return scene::compile_scene(std::move(root));
}

struct DeleteBatch {
  void operator()(mjBatch* batch) const { mjb_deleteBatch(batch); }
};

/// MuJoCo's batch of a scene's hand at the start, with position actuators of the controller's gains.
std::unique_ptr<mjBatch, DeleteBatch> in_mujoco_batch(const scene::Scene& scene, bool self_contact) {
  const auto model = mujoco::compile(
      test::written("mjcf", scene.model, scene.spec.solver, scene.control ? &*scene.control : nullptr));
  if (!self_contact) model->opt.disableflags |= mjDSBL_CONTACT;
  mjBatchConfig config;
  mjb_defaultConfig(&config);
  config.nthread = kThreads;
  char error[1000] = "";
  std::unique_ptr<mjBatch, DeleteBatch> out(mjb_makeBatch(model.get(), kHands, &config, error, sizeof error));
  if (!out) throw std::runtime_error(error);
  const std::vector<int> keys(kHands, 0);
  mjb_reset(out.get(), nullptr, kHands, keys.data(), 0);
  int count = 0;
  mjtNum* control = mjb_stateComponent(out.get(), mjSTATE_CTRL, &count);
  for (int i = 0; i < kHands; ++i) std::fill_n(control + i * mjb_nstate(out.get()), count, kTarget);
  return out;
}

/// 1,024 hands on two threads, which hold the same angles, wall time of a step of one: MuJoCo's mjBatch (the
/// yardstick), and a Batch here.
void hands_on_two_threads(benchmark::State& state, int steps, bool self_contact) {
  const scene::Scene scene = controlled_hand(self_contact);
  const auto there = in_mujoco_batch(scene, self_contact);
  environment::Batch here(scene, kHands, {.threads = kThreads});
  const std::vector<double> angles(kHands * here[0].simulation().controller()->axes().size(), kTarget);
  const auto step_there = [&] { mjb_step(there.get(), nullptr, kHands, steps, 0); };
  const auto step_here = [&] { here.step({.angles = angles}, steps); };
  step_there();
  step_here();
  std::vector<double> of_peer, own, ratios;
  for (auto unused : state) {
    (void)unused;
    of_peer.push_back(wall(step_there));
    own.push_back(wall(step_here));
    ratios.push_back(own.back() / of_peer.back());
    state.SetIterationTime(own.back());
  }
  std::size_t touching = 0;
  for (std::size_t i = 0; i < here.size(); ++i) touching += here[i].simulation().engine().contacts().size();
  state.counters["touching"] = static_cast<double>(touching);
  state.counters["ratio"] = median(ratios);
  state.counters["yardstick_us"] = 1e6 * median(of_peer) / (kHands * steps);
  state.counters["candidate_us"] = 1e6 * median(own) / (kHands * steps);
}
BENCHMARK_CAPTURE(hands_on_two_threads, steps_10, 10, false)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(hands_on_two_threads, steps_40, 40, false)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(hands_on_two_threads, self_contact_40, 40, true)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
#endif
#endif

#ifdef HANDSIM_WITH_PINOCCHIO
Placement plain(const Pose& pose) {
  Placement out;
  Eigen::Map<Mat3>(out.rotation.data()) = pose.q.toRotationMatrix();
  Eigen::Map<Vec3>(out.translation.data()) = pose.p;
  return out;
}

/// Of a hand on a still palm, which has hinges and universals alone.
std::vector<TreeJoint> tree_of(const model::Model& model) {
  std::vector<TreeJoint> out;
  std::vector<int> joint_of(model.bodies.size(), -1);
  std::vector<Pose> in_joint(model.bodies.size());
  for (std::size_t i = 0; i < in_joint.size(); ++i) in_joint[i] = model.bodies[i].zero_pose;
  for (const model::Joint& joint : model.joints) {
    const auto parent = static_cast<std::size_t>(joint.parent), child = static_cast<std::size_t>(joint.child);
    TreeJoint& next = out.emplace_back();
    next.parent = joint_of[parent];
    next.axes = static_cast<int>(joint.axes.size());
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      Eigen::Map<Vec3>(next.axis[a].data()) = joint.axes[a].axis;
    next.in_parent = plain(in_joint[parent] * joint.parent_frame);
    in_joint[child] = joint.child_frame.inverse();
    next.body = plain(in_joint[child]);
    next.mass = model.bodies[child].mass;
    Eigen::Map<Mat3>(next.inertia.data()) = model.bodies[child].inertia;
    joint_of[child] = static_cast<int>(out.size()) - 1;
  }
  return out;
}

/// Yardstick: Pinocchio's accelerations from torques alone (ABA) or torques from accelerations (RNEA), on the
/// same tree. Candidate: a whole step here, with stops, tissue and servos.
void step_against_pinocchio(benchmark::State& state, bool aba) {
  const Load load = one_hand();
  const Vec3& g = load.scene.model.gravity;
  const PinocchioCalls calls = pinocchio_calls(tree_of(load.scene.model), {g.x(), g.y(), g.z()}, kSteps);
  engine::articulated::ArticulatedEngine engine(load.scene.model, smooth(load.scene));
  const model::State start = model::initial_state(load.scene.model);
  compare(
      state, kSteps, [&] { engine.set_state(start); }, aba ? calls.aba : calls.rnea,
      [&] {
        for (std::size_t i = 0; i < kSteps; ++i) engine.step({.servos = load.servos[i % kTurns]});
      });
}
BENCHMARK_CAPTURE(step_against_pinocchio, aba, true)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(step_against_pinocchio, rnea, false)->UseManualTime()->Unit(benchmark::kMillisecond);
#endif

}  // namespace
}  // namespace handsim::bench

BENCHMARK_MAIN();
