#include "handsim/study/effects/effects.h"

#include <gtest/gtest.h>

#include <cmath>

#include <nlohmann/json.hpp>

#include "handsim/model/kinematics.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::study {
namespace {

using model::Effect;

scene::Scene scene_of(const std::string& text) { return scene::compile_scene(parse_yaml(text, "test.yaml")); }

const EffectRow& row_of(const EffectsResult& result, Effect effect) {
  for (const EffectRow& row : result.rows)
    if (row.name == model::name(effect)) return row;
  throw std::runtime_error("no row");
}

/// The whole study; its files are removed.
StudyEnd study_of(const scene::Scene& scene) {
  const test::TemporaryFolder folder;
  return effects(scene, {{}, {}, 1}, {folder.path()});
}

constexpr const char* kBall =
    "objects: [{name: ball, shape: sphere, radius: 0.1, mass: 1, position: [0, 0, 0]}]\nduration: 0.5\n";

// Oracle: free fall under semi-implicit Euler, g h^2 n (n + 1) / 2, that is g t^2 / 2 to first order.
TEST(Effects, WithoutGravityAFreeBodyStaysAtItsStart) {
  const EffectsResult result =
      run_effects(scene_of(std::string(kBall) + "effects: [gravity]\ngravity: [0, 0, -10]\n"), 1, nullptr);
  ASSERT_EQ(result.rows.size(), 1U);
  EXPECT_EQ(result.steps, 500);
  EXPECT_FALSE(result.has_angles);
  EXPECT_NEAR(result.rows[0].displacement.value, 10 * 1e-6 * 500 * 501 / 2, 1e-12);
  EXPECT_NEAR(result.rows[0].displacement.value, 0.5 * 10 * 0.25, 10 * 1e-3 * 0.5);
  EXPECT_EQ(result.rows[0].displacement.where, "ball");
  EXPECT_NEAR(result.rows[0].displacement.time, 0.5, 1e-12);
}

// Oracle: a pendulum that starts horizontally. Without gravity it rests, so the largest difference is the
// angle of the complete scene. Energy: w^2 = 2 m g l sin(q) / (I + m l^2); it passes the lowest point, so the
// difference is more than 90 degrees.
TEST(Effects, AngleDifferencesEqualTheMotionIfTheVariantRests) {
  const scene::Scene scene = scene_of(
      "bodies: [{name: bob, mass: 0.1, inertia: [1e-4, 1e-4, 1e-4], position: [0.1, 0, 0]}]\n"
      "joints: [{name: pin, type: hinge, parent: world, child: bob, position: [0, 0, 0], axes: [{name: "
      "swing, "
      "axis: [0, 1, 0]}]}]\n"
      "effects: [gravity]\nduration: 0.3\n");
  const EffectRow row = run_effects(scene, 1, nullptr).rows[0];
  simulation::Simulation whole(scene);
  double largest = 0, sum = 0;
  for (long i = 0; i < whole.step_count(); ++i) {
    whole.step();
    const double q = whole.state().q[0];
    largest = std::max(largest, std::abs(q)), sum += q * q;
  }
  EXPECT_GT(largest, M_PI / 2);
  EXPECT_NEAR(row.angle.value, largest, 1e-12);
  EXPECT_NEAR(row.angle_rms, std::sqrt(sum / static_cast<double>(whole.step_count())), 1e-12);
  EXPECT_EQ(row.angle.where, "pin.swing");
}

// Oracle: bit equality; the gravity is zero.
TEST(Effects, AnEffectWithoutInfluenceChangesNothing) {
  scene::Scene scene = test::shipped_scene("two_hands", {"gravity=[0, 0, 0]", "duration=0.2"});
  const EffectsResult result = run_effects(scene, 5, nullptr);
  const EffectRow& gravity = row_of(result, Effect::gravity);
  EXPECT_EQ(gravity.angle.value, 0);
  EXPECT_EQ(gravity.angle_rms, 0);
  EXPECT_EQ(gravity.displacement.value, 0);
}

// Oracle: the contract: without the last contact effect, friction is removed too and the row says so.
TEST(Effects, DependentEffectsAreRemovedTogether) {
  const scene::Scene scene =
      scene_of(std::string(kBall) + "ground: {height: -0.1}\neffects: [gravity, ground_contact, friction]\n");
  const EffectsResult result = run_effects(scene, 1, nullptr);
  // Speculative contacts have a row.
  ASSERT_EQ(result.rows.size(), 4U);
  EXPECT_EQ(result.rows.back().name, "solver.speculative");
  EXPECT_EQ(result.rows.back().displacement.value, 0);
  EXPECT_EQ(row_of(result, Effect::ground_contact).with, std::vector{Effect::friction});
  EXPECT_TRUE(row_of(result, Effect::friction).with.empty());
  // Without the ground the ball falls on.
  EXPECT_NEAR(row_of(result, Effect::ground_contact).displacement.value, 0.5 * 9.80665 * 0.25, 0.01);
  EXPECT_NE(study_of(scene).text.find("ground_contact with friction"), std::string::npos);
}

// Oracle: the contract: a solver setting that is on has a row.
TEST(Effects, HaveRowsForSolverSettings) {
  const scene::Scene scene =
      scene_of(std::string(kBall) + "effects: [gravity]\nsolver: {projection: true}\n");
  const EffectsResult result = run_effects(scene, 1, nullptr);
  ASSERT_EQ(result.rows.size(), 2U);
  EXPECT_EQ(result.rows[1].name, "solver.projection");
  EXPECT_FALSE(result.rows[1].fault);
}

// Oracle: the contract: a scene that fails without the effect has a row with the fault. Without the ground
// the ball is faster than 1000 m/s.
TEST(Effects, WithoutWhichTheSceneFailsHaveARowWithTheFault) {
  const scene::Scene scene = scene_of(
      "objects: [{name: ball, shape: sphere, radius: 0.1, mass: 1, position: [0, 0, 0.1]}]\nduration: 1.2\n"
      "ground: {height: 0}\neffects: [gravity, ground_contact]\ngravity: [0, 0, -1000]\n");
  const EffectsResult result = run_effects(scene, 1, nullptr);
  const EffectRow& ground = row_of(result, Effect::ground_contact);
  ASSERT_TRUE(ground.fault.has_value());
  EXPECT_NE(ground.fault->find("ball: speed"), std::string::npos) << *ground.fault;
  EXPECT_FALSE(row_of(result, Effect::gravity).fault.has_value());
  const auto json = nlohmann::json::parse(study_of(scene).json);
  EXPECT_EQ(json["rows"][1]["fault"], *ground.fault);
}

// Oracle: the contract, on a shipped scene: every effect can be removed, also with control and a driven
// wrist.
TEST(Effects, OfAControlledSceneOnADrivenWristCanAllBeRemoved) {
  const scene::Scene scene = test::shipped_scene("pose_tracking", {"duration=0.05"});
  const EffectsResult result = run_effects(scene, 1, nullptr);
  EXPECT_FALSE(row_of(result, Effect::actuation).fault) << *row_of(result, Effect::actuation).fault;
  EXPECT_FALSE(row_of(result, Effect::wrist_motion).fault) << *row_of(result, Effect::wrist_motion).fault;
  EXPECT_GT(row_of(result, Effect::actuation).angle.value, 0);
}

TEST(EffectsFiles, AreWritten) {
  const test::TemporaryFolder folder;
  scene::Scene scene = scene_of(std::string(kBall) + "title: \"it's \\\\ `x`\"\neffects: [gravity]\n");
  EXPECT_TRUE(effects(scene, {{}, {}, 1}, {folder.path()}).plotted);
  const std::string csv = test::text_of(folder.path() / "effects.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);
  for (const char* file : {"effects.json", "effects.png", "effects.svg"})
    EXPECT_GT(std::filesystem::file_size(folder.path() / file), 100U) << file;
}

}  // namespace
}  // namespace handsim::study
