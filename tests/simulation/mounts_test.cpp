// Each way of holding a wrist does to the palm what it says.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>

#include "handsim/model/kinematics.h"
#include "handsim/model/shape_extent.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::simulation {
namespace {

scene::Scene mounted(const std::string& side, const std::string& wrist, const std::string& effects) {
  return scene::compile_scene(parse_yaml(
      "hands: [{model: ../handmodels/anatomical.yaml, person: persons/median_man.yaml, side: " + side +
          ", wrist: " + wrist + "}]\nduration: 1\neffects: " + effects + "\n",
      test::in_source("config/test.yaml")));
}

/// X_WH after some steps.
Pose hand_frame(const scene::Scene& scene, const model::State& state) {
  const model::HandIndex& hand = scene.model.hands[0];
  return state.bodies[static_cast<std::size_t>(hand.palm)].pose() * hand.wrist_frame;
}

void run_steps(Simulation& simulation, int steps) {
  for (int i = 0; i < steps; ++i) simulation.step();
}

TEST(FixedWrist, NeverMovesThePalm) {
  const scene::Scene scene =
      mounted("right", "{mount: fixed, position: [1, 2, 3]}", "[gravity, joint_stops]");
  Simulation simulation(scene);
  run_steps(simulation, 300);
  EXPECT_EQ(hand_frame(scene, simulation.state()).p, hand_frame(scene, model::initial_state(scene.model)).p);
}

// A hand lies level, back up: weight flexes the wrist about the radio-ulnar axis and nothing else turns.
TEST(HingedWrist, TurnsAboutFlexionAlone) {
  for (const char* side : {"right", "left"}) {
    const scene::Scene scene = mounted(side, "{mount: hinge, position: [0, 0, 1]}", "[gravity]");
    Simulation simulation(scene);
    run_steps(simulation, 100);
    const Pose frame = hand_frame(scene, simulation.state());
    const Vec3 turn = rotation_vector(frame.q);
    EXPECT_LT(turn.x(), -0.1) << side;
    EXPECT_NEAR(turn.y(), 0, 1e-5) << side;
    EXPECT_NEAR(turn.z(), 0, 1e-5) << side;
    EXPECT_NEAR((frame.p - Vec3(0, 0, 1)).norm(), 0, 1e-4) << side;
  }
}

/// Height of the palm's lowest point [m].
double lowest_of_palm(const scene::Scene& scene, const model::State& state) {
  const int palm = scene.model.hands[0].palm;
  double lowest = INFINITY;
  for (const model::Shape& shape : scene.model.shapes) {
    if (shape.body != palm) continue;
    const Pose pose = state.bodies[static_cast<std::size_t>(palm)].pose() * shape.pose;
    lowest = std::min(lowest, pose.p.z() - model::support(shape, pose.q.conjugate() * -Vec3::UnitZ()));
  }
  return lowest;
}

/// Mount, floor, solver.
class PalmOnAWrist : public testing::TestWithParam<std::tuple<std::string, std::string, std::string>> {};
INSTANTIATE_TEST_SUITE_P(
    , PalmOnAWrist,
    testing::Combine(
        testing::Values("hinge", "universal"),
        testing::Values("objects: [{name: plate, shape: box, static: true, edges: [0.4, 0.4, 0.02], "
                        "position: [0, 0, -0.01]}]\ncontacts: {rules: [{between: [palm, plate]}]}\n"
                        "effects: [gravity, joint_stops, passive_tissue, object_contact]\n",
                        "ground: {height: 0}\ncontacts: {rules: [{between: [palm, ground]}]}\n"
                        "effects: [gravity, joint_stops, passive_tissue, ground_contact]\n"),
        testing::Values("{engine: ode}", "{engine: ode, method: quick_step, iterations: 50}",
                        "{engine: articulated}")));

// The wrist stands 40 mm above the floor: the palm, which starts level, swings down until it lies there.
// Fingers have no rule and pass. Oracle: the floor's height, within the 0.1 mm that a rigid contact of either
// engine may sink in.
TEST_P(PalmOnAWrist, SwingsUntilItLiesOnWhatStandsStill) {
  const auto& [mount, floor, solver] = GetParam();
  const scene::Scene scene = scene::compile_scene(parse_yaml(
      "hands: [{model: ../handmodels/anatomical.yaml, person: persons/median_man.yaml, side: "
      "right, wrist: {mount: " +
          mount + ", position: [0, 0, 0.04]}}]\nduration: 2\n" + floor + "solver: " + solver + "\n",
      test::in_source("config/test.yaml")));
  Simulation simulation(scene);
  run_steps(simulation, static_cast<int>(simulation.step_count()));
  EXPECT_NEAR(lowest_of_palm(scene, simulation.state()), 0, 1e-4);
  EXPECT_LT(simulation.state().bodies[static_cast<std::size_t>(scene.model.hands[0].palm)].w.norm(), 1e-2);
}

TEST(UniversalWrist, HoldsTheWristCentreAndKeepsItsAxesPerpendicular) {
  const scene::Scene scene = mounted(
      "right", "{mount: universal, position: [0, 0, 1], rotation: {axis: [0, 1, 0], angle: \"60 deg\"}}",
      "[gravity, joint_stops, passive_tissue]");
  Simulation simulation(scene);
  run_steps(simulation, 1000);
  const std::vector<double> q = simulation.state().q;
  EXPECT_GT(std::abs(q[0]) + std::abs(q[1]), 0.02);
  EXPECT_LT(simulation.get<Monitor>().joint_gap().value, 1e-4);
}

// Oracle: semi-implicit Euler of a falling point, z = -g h^2 n (n + 1) / 2, for the hand's centre of mass.
TEST(FreeWrist, FallsAsOneBody) {
  const scene::Scene scene =
      mounted("left", "{mount: free, position: [0, 0, 0], velocity: [0.3, 0, 0]}", "[gravity]");
  Simulation simulation(scene);
  const auto centre = [&] {
    Vec3 sum = Vec3::Zero();
    double mass = 0;
    for (std::size_t i = 1; i < scene.model.bodies.size(); ++i) {
      sum += scene.model.bodies[i].mass * simulation.state().bodies[i].p;
      mass += scene.model.bodies[i].mass;
    }
    return Vec3(sum / mass);
  };
  const Vec3 start = centre();
  const int n = 500;
  run_steps(simulation, n);
  const double h = scene.spec.solver.step;
  const Vec3 expected(0.3 * n * h, 0, -9.80665 * h * h * n * (n + 1) / 2);
  EXPECT_LT((centre() - start - expected).norm(), 1e-9);
}

// Oracle: the trajectory itself.
TEST(DrivenWrist, FollowsItsKeyframes) {
  const scene::Scene scene =
      mounted("right",
              "{mount: driven, motion: {keyframes: [{time: 0, position: [0, 0, 1]},"
              " {time: 0.5, position: [0.2, 0, 1.1], rotation: {axis: [1, 1, 0], angle: \"120 deg\"}}]}}",
              "[gravity, joint_stops, passive_tissue, wrist_motion]");
  Simulation simulation(scene);
  double worst = 0;
  for (int i = 0; i < 600; ++i) {
    simulation.step();
    const Pose wanted = scene.model.drives[0].motion.at(simulation.state().time);
    const Pose found = hand_frame(scene, simulation.state());
    worst = std::max(
        {worst, (wanted.p - found.p).norm(), rotation_vector(wanted.q.conjugate() * found.q).norm()});
  }
  EXPECT_LT(worst, 1e-12);
  EXPECT_LT(simulation.get<Monitor>().joint_gap().value, 5e-4);
}

}  // namespace
}  // namespace handsim::simulation
