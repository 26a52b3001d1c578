// What contacts cost either of ODE's solvers: the measurements behind method auto. Asserts nothing.
#include <benchmark/benchmark.h>

#include "bench/paired.h"
#include "engine/models.h"
#include "handsim/simulation/simulation.h"
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
BENCHMARK_CAPTURE(grasp, auto_50, "auto")->UseManualTime()->Iterations(3)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(grasp, world_step, "world_step")
    ->UseManualTime()
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(grasp, quick_step_50, "quick_step")
    ->UseManualTime()
    ->Iterations(3)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace handsim::bench
