// Fast bodies and thin ones: contact before it happens, and the warnings where it comes too late.
#include "handsim/simulation/watch/tunnelling.h"

#include <gtest/gtest.h>

#include <fmt/format.h>

#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::simulation {
namespace {

scene::Scene scene_of(const std::string& text) { return scene::compile_scene(parse_yaml(text, "test.yaml")); }

const std::vector<std::string> kSolvers = {"method: world_step", "method: quick_step", "engine: articulated"};

struct FallCase {
  std::string solver = "method: world_step";
  std::string thing = "shape: sphere, radius: 0.01";
  std::string target = "shape: box, edges: [1, 1, 0.005]";
  double speed = 50, start = 1.5, step = 1e-3, duration = 0.05;
  double restitution = 0;
  std::string gravity = "[0, 0, 0]", more = "", effects = "gravity, object_contact, friction";
};

/// A thing that comes straight down on a fixed one at a height of 1 m, off the middle by a little.
scene::Scene thrown(const FallCase& of) {
  return scene_of(fmt::format(
      "objects:\n"
      "  - {{name: target, {}, position: [0, 0, 1], static: true}}\n"
      "  - {{name: b, {}, mass: 0.1, position: [0.001, 0.002, {}], velocity: [0, 0, {}], restitution: {}}}\n"
      "{}"
      "gravity: {}\neffects: [{}]\nsolver: {{{}, step: {}}}\nduration: {}\n",
      of.target, of.thing, of.start, -of.speed, of.restitution, of.more, of.gravity, of.effects, of.solver,
      of.step, of.duration));
}

/// Runs it through. @return the height at the end
double run_through(Simulation& simulation) {
  for (long i = 0; i < simulation.step_count(); ++i) simulation.step();
  return simulation.state().bodies.back().p.z();
}

std::string warnings_of(const Simulation& simulation) {
  std::string out;
  for (const std::string& warning : simulation.warnings()) out += warning + "\n";
  return out;
}

// Oracle: 50 mm a step against a slab of 5 mm, whose surface is at 1.0025 m; Newton's law of restitution. The
// solvers' own compliance is far below the tolerances.
TEST(Tunnelling, AFastBallLeavesAThinSlabByItsRestitutionInEveryEngine) {
  for (const std::string& solver : kSolvers)
    for (const double restitution : {0.0, 0.6}) {
      const scene::Scene scene = thrown({.solver = solver, .speed = 50, .restitution = restitution});
      Simulation simulation(scene);
      const double end = run_through(simulation);
      if (restitution > 0) {
        EXPECT_GT(end, 1.1) << solver;
      } else {
        EXPECT_NEAR(end, 1.0125, 1e-4) << solver;
        EXPECT_LE(simulation.get<Tunnelling>().penetration().value, 1e-4) << solver;
      }
      EXPECT_NEAR(simulation.state().bodies.back().v.z(), restitution * 50, restitution > 0 ? 0.01 : 1e-3)
          << solver;
      EXPECT_EQ(simulation.get<Tunnelling>().pairs(), 0) << solver;
    }
}

// Oracle: geometry: in its 11th step the ball goes from 20 mm above the slab's middle to 30 mm below.
TEST(Tunnelling, ABallThatPassesIsReportedWithTimeAndNames) {
  for (const std::string& solver : kSolvers) {
    const scene::Scene scene =
        thrown({.solver = solver + ", speculative: false", .start = 1.52, .duration = 0.02});
    Simulation simulation(scene);
    EXPECT_LT(run_through(simulation), 0.98) << solver;
    ASSERT_EQ(simulation.get<Tunnelling>().pairs(), 1) << solver;
    EXPECT_NEAR(simulation.get<Tunnelling>().first_time(), 0.011, 1e-9) << solver;
    const std::vector<std::string> warnings = simulation.warnings();
    ASSERT_FALSE(warnings.empty());
    EXPECT_NE(warnings.back().find("b passed through target at 0.011 s"), std::string::npos)
        << warnings.back();
  }
}

// Every form of body on every form of obstacle. Oracle: it stays on the side it came from.
TEST(Tunnelling, NoShapePassesAnother) {
  const std::vector<std::string> things = {
      "shape: sphere, radius: 0.01",
      "shape: capsule, radius: 0.01, length: 0.05, rotation: {axis: [1, 0, 0], angle: 1.2}",
      "shape: box, edges: [0.02, 0.03, 0.04], rotation: {axis: [1, 2, 0], angle: 0.5}",
      "shape: cylinder, radius: 0.02, length: 0.03, rotation: {axis: [0, 1, 0], angle: 0.4}"};
  const std::vector<std::string> targets = {
      "shape: box, edges: [1, 1, 0.005]", "shape: sphere, radius: 0.05",
      "shape: cylinder, radius: 0.3, length: 0.01",
      "shape: capsule, radius: 0.02, length: 0.5, rotation: {axis: [0, 1, 0], angle: 1.5708}"};
  for (const char* solver : {"method: world_step", "engine: articulated"})
    for (const std::string& thing : things)
      for (const std::string& target : targets) {
        const scene::Scene scene =
            thrown({.solver = solver, .thing = thing, .target = target, .duration = 0.011});
        Simulation simulation(scene);
        const std::string what = fmt::format("{} on {}, {}", thing, target, solver);
        EXPECT_GT(run_through(simulation), 1.0) << what;
        EXPECT_LT(simulation.state().bodies.back().v.norm(), 51) << what;
        // A capsule that lands on one end turns by more than 1 rad in the next step, and may lie deep for it.
        EXPECT_EQ(warnings_of(simulation).find("passed"), std::string::npos)
            << what << ": " << warnings_of(simulation);
      }
}

// Oracle: as above for two that move: head on at 50 m/s each they keep their order and their momentum.
TEST(Tunnelling, TwoFastBallsDoNotChangePlaces) {
  for (const std::string& solver : kSolvers) {
    const scene::Scene scene = scene_of(
        "objects:\n"
        "  - {name: low, shape: sphere, radius: 0.01, mass: 0.1, position: [0, 0, 1], velocity: [0, 0, 50]}\n"
        "  - {name: high, shape: sphere, radius: 0.01, mass: 0.2, position: [0.001, 0, 2], velocity: [0, 0, "
        "-50]}\n"
        "effects: [object_contact, friction]\nsolver: {" +
        solver + ", step: 1e-3}\nduration: 0.05\n");
    Simulation simulation(scene);
    run_through(simulation);
    const auto& bodies = simulation.state().bodies;
    EXPECT_LT(bodies[1].p.z(), bodies[2].p.z()) << solver;
    EXPECT_NEAR(0.1 * bodies[1].v.z() + 0.2 * bodies[2].v.z(), -5, 1e-9) << solver;
    EXPECT_EQ(simulation.get<Tunnelling>().pairs(), 0) << solver;
  }
}

// Oracle: a ball on level ground: its centre at its radius.
TEST(Tunnelling, ABallThatFallsInStepsOfATenthOfASecondEndsOnTheGround) {
  for (const std::string& solver : kSolvers)
    for (const char* thing :
         {"shape: sphere, radius: 0.05", "shape: box, edges: [0.1, 0.1, 0.1]",
          "shape: capsule, radius: 0.05, length: 0.1, rotation: {axis: [1, 0, 0], angle: 1.5}"}) {
      const FallCase of{.solver = solver,
                        .thing = thing,
                        .speed = 0,
                        .start = 3,
                        .step = 0.1,
                        .duration = 4,
                        .gravity = "[0, 0, -9.81]",
                        .more = "ground: {}\n",
                        .effects = "gravity, ground_contact, friction"};
      const scene::Scene scene = thrown(of);
      Simulation simulation(scene);
      EXPECT_NEAR(run_through(simulation), 0.05, 5e-3) << solver << thing;
      EXPECT_EQ(simulation.get<Tunnelling>().pairs(), 0) << solver << thing;
    }
}

// Oracle: the depth of the ball, which ends its step 0.1 s below the ground by up to v h.
TEST(Tunnelling, DeepBurialIsReportedWithItsDepthAndIsACriterion) {
  const FallCase of{.solver = "method: world_step, speculative: false",
                    .thing = "shape: sphere, radius: 0.05",
                    .speed = 0,
                    .start = 3,
                    .step = 0.1,
                    .duration = 2,
                    .gravity = "[0, 0, -9.81]",
                    .more = "ground: {}\ncriteria: {tunnelling: 0}\n",
                    .effects = "gravity, ground_contact, friction"};
  const scene::Scene scene = thrown(of);
  const test::TemporaryFolder folder;
  RunOptions options;
  options.out = folder.path();
  const RunResult result = run(scene, options);
  EXPECT_FALSE(result.passed());
  ASSERT_FALSE(result.warnings.empty());
  const std::string& warning = result.warnings.back();
  EXPECT_NE(warning.find("b lay "), std::string::npos) << warning;
  EXPECT_NE(warning.find("deep in ground"), std::string::npos) << warning;
  EXPECT_NE(warning.find("smallest radius of 50 mm"), std::string::npos) << warning;
  for (const Verdict& verdict : result.verdicts)
    if (verdict.name == "tunnelling") {
      EXPECT_EQ(verdict.measured, 1);
      EXPECT_FALSE(verdict.held());
    }
  EXPECT_NE(result.summary.find("tunnelling"), std::string::npos);
}

// Oracle: bit equality: nothing is fast.
TEST(Tunnelling, SlowScenesKeepTheirBits) {
  for (const std::string& solver : kSolvers) {
    const auto hash = [&](const char* more) {
      const scene::Scene scene =
          thrown({.solver = solver + more, .speed = 1, .start = 1.05, .duration = 0.1});
      Simulation simulation(scene);
      run_through(simulation);
      EXPECT_GT(simulation.get<Ledger>().contacts(), 0);
      return simulation.state_hash();
    };
    EXPECT_EQ(hash(""), hash(", speculative: false")) << solver;
  }
}

// Oracle: free flight. The ball's way passes the slab's edge at 20 mm, the nearest point of the slab always
// ahead of it.
TEST(Tunnelling, AFastBallThatMissesIsNotTouched) {
  for (const std::string& solver : kSolvers) {
    const scene::Scene scene = scene_of(
        "objects:\n"
        "  - {name: target, shape: box, edges: [1, 1, 0.005], position: [0, 0, 1], static: true}\n"
        "  - {name: b, shape: sphere, radius: 0.01, mass: 0.1, position: [0.46, 0, 1.07], velocity: [50, 0, "
        "-50]}\n"
        "effects: [object_contact, friction]\nsolver: {" +
        solver + ", step: 1e-3}\nduration: 0.01\n");
    Simulation simulation(scene);
    run_through(simulation);
    const model::BodyState& ball = simulation.state().bodies.back();
    EXPECT_EQ(ball.v, Vec3(50, 0, -50)) << solver;
    EXPECT_EQ(simulation.get<Ledger>().contacts(), 0) << solver;
  }
}

// Oracle: a pad is a spring: KE = k d^2 / 2. 5 m/s go in by 50 mm with 1e3 N/m, from above.
TEST(Tunnelling, APadGivesWayToAFastBallAsASpring) {
  for (const char* solver : {"method: world_step", "engine: articulated"}) {
    const FallCase of{.solver = solver,
                      .thing = "shape: sphere, radius: 0.1, stiffness: 1000, damping: 0",
                      .target = "shape: box, edges: [1, 1, 0.2]",
                      .speed = 5,
                      .start = 1.3,
                      .step = 1e-4,
                      .duration = 0.1};
    const auto deepest = [&](const char* more) {
      FallCase with = of;
      with.solver += more;
      const scene::Scene scene = thrown(with);
      Simulation simulation(scene);
      run_through(simulation);
      return simulation.get<Tunnelling>().penetration().value;
    };
    EXPECT_NEAR(deepest(""), 0.05, 0.002) << solver;
    // 5 mm of thickness are fast at 1e-4 s: half of 2.5 mm is more than 0.5 mm, so that the two agree.
    EXPECT_EQ(deepest(""), deepest(", speculative: false")) << solver;
  }
}

// A hand that falls at 30 m/s onto a slab of 4 mm. Oracle: the watcher, which finds that it passes without.
TEST(Tunnelling, AFastHandDoesNotPassAThinSlab) {
  const auto pairs = [](const char* solver, const char* speculative) {
    const scene::Scene scene = test::shipped_scene(
        "dropped_hand",
        {std::string("solver={") + solver + ", step: 1e-3, speculative: " + speculative + "}",
         "hands.0.wrist.velocity=[0, 0, -30]",
         "objects=[{name: slab, shape: box, edges: [2, 2, 0.004], position: [0, 0, -0.3], static: true}]",
         "ground={height: -2}",
         "effects=[gravity, joint_stops, passive_tissue, object_contact, ground_contact, friction]",
         "duration=0.03"});
    Simulation simulation(scene);
    for (long i = 0; i < simulation.step_count(); ++i) simulation.step();
    return simulation.get<Tunnelling>().pairs();
  };
  for (const char* solver : {"engine: articulated", "method: quick_step, iterations: 100"}) {
    EXPECT_GT(pairs(solver, "false"), 0) << solver;
    EXPECT_EQ(pairs(solver, "true"), 0) << solver;
  }
}

// Oracle: bit equality with the run that never stopped, and the same figures.
TEST(Tunnelling, ARunGoesOnFromASnapshotInFrontOfTheSlab) {
  for (const std::string& solver : kSolvers)
    for (const char* speculative : {"", ", speculative: false"}) {
      const scene::Scene scene = thrown({.solver = solver + speculative, .start = 1.52, .duration = 0.02});
      Simulation whole(scene), again(scene);
      for (int i = 0; i < 10; ++i) whole.step();
      const RunSnapshot snapshot = whole.snapshot();
      again.restore(snapshot);
      for (int i = 0; i < 10; ++i) whole.step(), again.step();
      EXPECT_EQ(whole.state_hash(), again.state_hash()) << solver;
      EXPECT_EQ(whole.warnings(), again.warnings()) << solver;
      EXPECT_EQ(whole.get<Tunnelling>().pairs(), *speculative ? 1 : 0) << solver;
    }
}

}  // namespace
}  // namespace handsim::simulation
