// What contacts cost either of ODE's solvers. Asserts nothing.
#include <benchmark/benchmark.h>

#include "bench/paired.h"
#include "engine/models.h"
#include "handsim/engine/collision/pair_table.h"
#include "handsim/simulation/simulation.h"
#include "handsim/study/grasp/grasp_study.h"
#include "scene_files.h"

namespace handsim::bench {
namespace {

using model::Effect;

/// A tower of boxes, each some contacts on the one below, with a chain of hinged links on the topmost: one
/// island of contact rows and joint rows.
model::Model tower(int boxes, int links) {
  model::Model model = model::make_model();
  engine::test::add_ground(model, 0.5);
  int parent = model::kWorld;
  for (int i = 0; i < boxes; ++i) {
    const double moment = 0.1 * 2 * 0.0016 / 12;
    parent = engine::test::add_body(
        model, engine::test::body("box" + std::to_string(i), 0.1, {moment, moment, moment},
                                  {Vec3(0, 0, 0.0199 + 0.0398 * i), Quat::Identity()}));
    model::Shape shape = engine::test::shape("shape" + std::to_string(i), model::ShapeKind::box, parent);
    shape.edges = Vec3::Constant(0.04);
    model.shapes.push_back(shape);
  }
  Pose at{Vec3(0.02, 0, 0), Quat::Identity()};
  for (int i = 0; i < links; ++i) {
    const int child = engine::test::add_body(
        model, engine::test::body("link" + std::to_string(i), 0.02, {4e-6, 4e-6, 1e-6}));
    engine::test::add_joint(model, "joint" + std::to_string(i), model::JointKind::hinge, parent, child, at,
                            {Vec3(0, 0, 0.02), Quat::Identity()}, {Vec3::UnitX()})
        .axes[0]
        .tissue = model::Tissue{0.02, 1e-3, 0};
    parent = child;
    at = {Vec3(0, 0, -0.02), Quat::Identity()};
  }
  return model;
}

/// Median time of a step without collision detection; counters: rows of the island and [us].
void island_cost(benchmark::State& state, engine::Method method) {
  const auto boxes = static_cast<int>(state.range(0));
  const auto links = static_cast<int>(state.range(1));
  const model::Model model = tower(boxes, links);
  engine::Settings settings = engine::test::settings(
      {Effect::gravity, Effect::ground_contact, Effect::friction, Effect::passive_tissue}, 1e-3, method);
  settings.ode().cfm = 1e-7;
  settings.ode().iterations = 50;
  const auto engine = engine::make_engine(model, settings);
  engine::test::run(*engine, 50);
  std::vector<double> times, contacts;
  for (auto unused : state) {
    (void)unused;
    double collide = 0;
    auto step = [&] {
      const engine::StepReport report = engine->step({});
      collide = 1e-9 * report.collide_ns;
      contacts.push_back(report.contacts);
    };
    const double whole = seconds(step);
    times.push_back(whole - collide);
    state.SetIterationTime(times.back());
  }
  state.counters["rows"] = 3 * median(contacts) + 6 * links;
  state.counters["us"] = 1e6 * median(times);
}
BENCHMARK_CAPTURE(island_cost, world_step, engine::OdeMethod::world_step)
    ->ArgsProduct({{1, 2, 4, 8, 12, 16}, {0, 12}})
    ->UseManualTime()
    ->Iterations(200);
BENCHMARK_CAPTURE(island_cost, quick_step_50, engine::OdeMethod::quick_step)
    ->ArgsProduct({{1, 2, 4, 8, 12, 16}, {0, 12}})
    ->UseManualTime()
    ->Iterations(200);

/// A mug held and lifted, the whole loop with control and figures, through 2 s: CPU time over simulated time.
void grasp(benchmark::State& state, const char* method) {
  const scene::Scene scene =
      test::shipped_scene("grasp_cup", {std::string("solver.method=") + method, "solver.iterations=50"});
  std::vector<double> ratios, contacts;
  for (auto unused : state) {
    (void)unused;
    simulation::Simulation simulation(scene);
    while (simulation.state().time < 2.5) simulation.step();  // the grip is closed
    auto hold = [&] {
      while (simulation.state().time < 4.5) {
        simulation.step();
        contacts.push_back(static_cast<double>(simulation.engine().contacts().size()));
      }
    };
    const double cpu = seconds(hold);
    state.SetIterationTime(cpu);
    ratios.push_back(cpu / 2);
  }
  state.counters["of_real_time"] = median(ratios);
  state.counters["contacts"] = median(contacts);
}
BENCHMARK_CAPTURE(grasp, world_step, "world_step")
    ->UseManualTime()
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(grasp, quick_step_50, "quick_step")
    ->UseManualTime()
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond);

/// Passes that steps took, and by which share of a step's largest friction limit a contact was beyond its
/// own.
class FrictionWatch final : public simulation::Watcher {
 public:
  explicit FrictionWatch(const simulation::Watched& watched)
      : model_(watched.scene.model), rules_(watched.scene.model) {}
  std::string_view name() const override { return "friction"; }
  void update(simulation::Step& step) override {
    ++steps;
    passes += step.report.passes;
    double largest = 0, beyond = 0;
    for (const engine::Contact& contact : step.engine.contacts()) {
      const model::Material between = rules_.between(shape(contact.shape_a), shape(contact.shape_b));
      if (!between.compliance) continue;
      const double limit = between.friction * std::max(contact.normal_force(), 0.0);
      largest = std::max(largest, limit);
      beyond = std::max(beyond, contact.friction_force().norm() - limit);
    }
    if (largest <= 0) return;
    sum += beyond / largest;
    most = std::max(most, beyond / largest);
  }
  void save(ArchiveWriter& /*out*/) const override {}
  void restore(ArchiveReader& /*in*/, const model::State& /*state*/) override {}

  double steps = 0, passes = 0, sum = 0, most = 0;

 private:
  const model::Shape& shape(int index) const { return model_.shapes[static_cast<std::size_t>(index)]; }

  const model::Model& model_;
  engine::PairTable rules_;
};

/// What more passes of the direct solver cost and buy in a grasp: time of a step and passes made, friction
/// beyond its cone (mean and largest), and the grasp's figures. By the most passes allowed.
void friction_passes(benchmark::State& state, const char* name, double friction) {
  scene::Scene scene = test::shipped_scene(name, {"grasps.0.hold=0.5 s"});
  study::set_friction(scene, friction);
  scene.spec.solver.ode().friction_passes = static_cast<int>(state.range(0));
  for (auto unused : state) {
    (void)unused;
    simulation::Simulation simulation(scene, simulation::only<simulation::Grasps, FrictionWatch>);
    const auto& grasps = simulation.get<simulation::Grasps>();
    auto run = [&] {
      while (simulation.steps() < simulation.step_count() && !grasps.failed()) simulation.step();
    };
    const double cpu = seconds(run);
    state.SetIterationTime(cpu);
    const auto& friction_watch = simulation.get<FrictionWatch>();
    const simulation::GraspFigures figures = grasps.figures().front();
    state.counters["us"] = 1e6 * cpu / friction_watch.steps;
    state.counters["passes"] = friction_watch.passes / friction_watch.steps;
    state.counters["beyond_mean"] = friction_watch.sum / friction_watch.steps;
    state.counters["beyond_most"] = friction_watch.most;
    state.counters["held"] = figures.held ? 1 : 0;
    state.counters["grip"] = figures.hold.normal;
    state.counters["shift_mm"] = 1e3 * figures.shift;
    state.counters["slip_um"] = 1e6 * figures.slip;
  }
}
BENCHMARK_CAPTURE(friction_passes, slippery_box, "agreement/box", 0.6)
    ->Arg(1)
    ->Arg(2)
    ->Arg(3)
    ->Arg(6)
    ->UseManualTime()
    ->Iterations(1)
    ->Repetitions(1)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(friction_passes, box, "agreement/box", 0.9)
    ->DenseRange(1, 3)
    ->UseManualTime()
    ->Iterations(1)
    ->Repetitions(1)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace handsim::bench
