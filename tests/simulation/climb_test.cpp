// Climbs: a palm on a rail, loaded until its grip fails.
#include <gtest/gtest.h>

#include <cmath>

#include "handsim/simulation/simulation.h"
#include "handsim/study/grasp/grasp_study.h"
#include "scene_files.h"
#include "support/sanitized.h"

namespace handsim::simulation {
namespace {

constexpr double kG = 9.80665;

ClimbFigures run(const scene::Scene& scene) {
  Simulation simulation(scene);
  const long steps = simulation.step_count();
  for (long i = 0; i < steps && !simulation.get<Climbs>().over(); ++i) simulation.step();
  return simulation.figures<Climbs>().front();
}

scene::Scene compiled(const std::string& text) {
  return scene::compile_scene(parse_yaml(text, test::in_source("config/test.yaml")));
}

/// A palm that faces up, on a rail across it; `rest` has objects, contacts, load and solver.
std::string palm_up(const std::string& rest, const std::string& load) {
  return "hands: [{model: ../handmodels/anatomical.yaml, person: persons/median_man.yaml, side: right, "
         "wrist: {mount: rail}}]\n"
         "control: {controller: ../controllers/climb.yaml, poses: {unit: deg, poses: {flat: {thumb_cmc: "
         "[-32, "
         "-22]}}}}\n"
         "climbs:\n"
         "  - {hold: wall, wrist: {position: [0, 0, 0.5], rotation: {axis: [0, 1, 0], angle: 180 deg}}, "
         "open: "
         "flat, closed: flat, approach: {height: 0, time: 0.05}, close: 0.05, settle: 0.1, load: " +
         load + ", strength: ../handmodels/grip_strength.yaml}\n" + rest;
}

/// 40 kg on the palm, between its pads and the fingers, kept back by a smooth wall: friction with a known
/// normal force holds the palm.
std::string block_on_palm(double friction, const std::string& solver) {
  return palm_up(
      "objects:\n"
      "  - {name: block, shape: box, edges: [0.06, 0.02, 0.06], mass: 40, position: [0, 0.08, 0.54566]}\n"
      "  - {name: wall, shape: box, static: true, edges: [0.1, 0.05, 0.05], position: [-0.08, 0.08, 0.545]}\n"
      "contacts:\n"
      "  materials: [{name: rough, friction: " +
          std::to_string(friction) +
          "}, {name: smooth, friction: 0}]\n"
          "  rules: [{between: [palm, block], material: rough}, {between: [block, wall], material: smooth}]\n"
          "effects: [gravity, object_contact, friction, joint_stops, actuation]\n" +
          solver,
      "{direction: [-1, 0, 0], rate: 40, max: 350 N}");
}

/// Of the hand [N].
double weight(const scene::Scene& scene) {
  double mass = 0;
  for (const model::Body& body : scene.model.bodies)
    if (!body.kinematic) mass += body.mass;
  return mass * kG;
}

class ClimbOracle : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, ClimbOracle,
                         testing::Values("solver: {cfm: 1e-8}\n", "solver: {step: 2 ms, cfm: 1e-8}\n",
                                         "solver: {engine: articulated}\n"));

// Oracle: Coulomb. The grip is friction under a weight: it fails at mu m g. The rate of the load and the
// speed that counts as held make 0.5 %.
TEST_P(ClimbOracle, FrictionUnderAWeightFailsAtItsLimit) {
  HANDSIM_SKIP_WITH_SANITIZER("other climbs load a palm");
  for (const double friction : {0.3, 0.6}) {
    const ClimbFigures figures = run(compiled(block_on_palm(friction, GetParam())));
    EXPECT_TRUE(figures.failed);
    EXPECT_NEAR(figures.carried, friction * 40 * kG, 0.01 * friction * 40 * kG);
    EXPECT_GE(std::abs(figures.travel), kFailedTravel);
  }
}

// Oracle: a palm that a wall stops cannot fail: it carries all that there is.
TEST(Climb, APalmAgainstAWallCarriesAllOfTheLoad) {
  const scene::Scene scene = compiled(
      palm_up("objects: [{name: wall, shape: box, static: true, edges: [0.04, 0.06, 0.1], position: "
              "[0.01, 0.043, 0.434]}]\n"
              "contacts: {rules: [{between: [palm, objects]}]}\n"
              "effects: [gravity, object_contact, friction, joint_stops, actuation]\nsolver: {cfm: 1e-8}\n",
              "{direction: [0, 0, -1], rate: 500, max: 500 N}"));
  const ClimbFigures figures = run(scene);
  EXPECT_FALSE(figures.failed);
  EXPECT_NEAR(figures.carried, 500, 1e-6);
  ASSERT_EQ(figures.last.parts.size(), 1U);
  EXPECT_EQ(figures.last.parts.front().part, "palm");
  // What bears it is the load and the hand's weight.
  EXPECT_NEAR(figures.last.parts.front().normal, figures.last.load + weight(scene), 1);
}

// Oracle: the mount: the palm, with fingers that swing from loose joints, moves along the line and does not
// turn.
TEST(Rail, LeavesThePalmOneLineAndNoTurn) {
  const scene::Scene scene = compiled(
      "hands: [{model: ../handmodels/anatomical.yaml, person: persons/median_man.yaml, side: left, wrist: "
      "{mount: rail, position: [0, 0, 1], along: [0, 3, -4]}}]\neffects: [gravity]\nduration: 0.1\n");
  Simulation simulation(scene);
  for (long i = 0; i < simulation.step_count(); ++i) simulation.step();
  const model::State& state = simulation.state();
  const model::BodyState& palm = state.bodies[static_cast<std::size_t>(scene.model.hands.front().palm)];
  EXPECT_NEAR(palm.v.x(), 0, 1e-9);
  EXPECT_NEAR(palm.v.y() * -4, palm.v.z() * 3, 1e-9);
  EXPECT_GT(palm.v.y(), 0.4);
  EXPECT_LT(palm.w.norm(), 1e-9);
}

scene::Scene half_crimp(const std::vector<std::string>& overrides = {}) {
  return test::shipped_scene("climb_half_crimp", overrides);
}

// Oracle: statics; under a slow load the hold bears the load and the hand's weight.
TEST(Climb, TheHoldBearsTheLoadAndTheHand) {
  const scene::Scene scene = half_crimp();
  Simulation simulation(scene);
  while (load_at(scene.plans.climbs.front(), simulation.state().time) < 100) simulation.step();
  double up = 0;
  for (const engine::Contact& contact : simulation.engine().contacts()) {
    const bool first = scene.model.shapes[static_cast<std::size_t>(contact.shape_b)].body == model::kWorld;
    up += (first ? 1 : -1) * contact.force.z();
  }
  const double wanted = 100 + weight(scene);
  EXPECT_NEAR(up, wanted, 0.01 * wanted);
}

/// Both tendons press on A2, the deep one on A4, where it turns less by 0.45 over 0.55, none where the PIP is
/// straight; a fingertip's force takes a tendon that is stronger than it, since its lever is longer than the
/// tendon's arm. Ligaments hold a part of the DIP's moment only where it lies on its stop: elsewhere the deep
/// flexor holds all of it, as the hand is almost at rest.
void expect_pulleys(const LoadedGrip& grip) {
  EXPECT_EQ(grip.fingers.size(), 4u);
  double pulleys = 0;
  for (const FingerLoad& load : grip.fingers) {
    if (load.deep == 0) continue;
    const double part = load.deep / (load.deep + load.superficial) * load.a2;
    EXPECT_GE(part, load.a4) << load.finger;
    EXPECT_LE(part, 0.55 / 0.45 * load.a4 + 1e-6) << load.finger;
    EXPECT_LT(load.a2, load.deep + load.superficial) << load.finger;
    pulleys += load.a4;
  }
  double tendons = 0;
  for (const FingerLoad& load : grip.fingers) tendons += load.deep + load.superficial;
  EXPECT_GT(tendons, grip.load);
  EXPECT_GT(pulleys, 10);
}

class ShippedClimb : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(, ShippedClimb, testing::Values("climb_half_crimp", "climb_open_hand", "climb_jug"));

// Oracle: the scene's own least load; the mirror; the step's order; Coulomb (less friction, less load).
TEST_P(ShippedClimb, FailsAtALoadThatBothHandsShareAndFrictionLowers) {
  HANDSIM_SKIP_WITH_SANITIZER("a shorter test loads a grip");
  const scene::Scene scene = test::shipped_scene(GetParam());
  const ClimbFigures right = run(scene);
  EXPECT_TRUE(right.failed);
  EXPECT_GE(right.carried, *scene.spec.criteria.climb_load);
  expect_pulleys(right.last);
  scene::Scene twice = test::shipped_scene(GetParam(), {"solver.step=2 ms"});
  const ClimbFigures coarse = run(twice);
  EXPECT_NEAR(coarse.carried, right.carried, 0.05 * right.carried);
  const ClimbFigures left = run(test::shipped_scene(GetParam(), {"solver.step=2 ms", "hands.0.side=left"}));
  EXPECT_NEAR(left.carried, coarse.carried, 0.01 * coarse.carried);
  study::set_friction(twice, 0.05);
  EXPECT_LT(run(twice).carried, 0.75 * coarse.carried);
}

// Oracle: a torque's lever: with half the grip strength every flexor has half the torque.
TEST(Climb, HalfTheGripStrengthCarriesAboutHalfTheLoad) {
  HANDSIM_SKIP_WITH_SANITIZER("a shorter test loads a grip");
  const ClimbFigures full = run(half_crimp({"solver.step=2 ms"}));
  const std::string person =
      "hands.0.person={stature: 1.755, mass: 84.5, sex: male, grip_strength: 262.35 N}";
  const ClimbFigures half = run(half_crimp({person, "solver.step=2 ms"}));
  EXPECT_TRUE(half.strength.measured);
  EXPECT_NEAR(half.strength.norm, full.strength.norm, 1e-12);
  EXPECT_NEAR(half.carried, 0.5 * full.carried, 0.08 * full.carried);
}

}  // namespace
}  // namespace handsim::simulation
