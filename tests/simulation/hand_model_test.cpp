// A hand with every kind of row of a hand model file, in the engines and exports.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "handsim/simulation/simulation.h"
#include "scene_files.h"
#include "support/written.h"

namespace handsim::simulation {
namespace {

scene::Scene scene_of(const std::string& side, const std::string& solver,
                      const std::string& model = "../tests/data/hands/every_joint.yaml") {
  return scene::compile_scene(
      parse_yaml("hands: [{model: " + model + ", person: persons/median_man.yaml, side: " + side +
                     ", wrist: {mount: hinge, position: [0, 0, 1]}}]\nduration: 0.15\n"
                     "effects: [gravity, joint_stops, passive_tissue]\nsolver: {" +
                     solver + ", step: 0.0001}\n",
                 test::in_source("config/test.yaml")));
}

model::State end_of(const scene::Scene& scene) {
  Simulation simulation(scene);
  for (long i = 0; i < simulation.step_count(); ++i) simulation.step();
  return simulation.state();
}

// Oracle: two engines. Both are of first order: bodies of about 1 m/s may part by some steps of 0.1 mm.
TEST(EveryKindOfRow, MovesEquallyInBothEngines) {
  for (const char* side : {"right", "left"}) {
    const scene::Scene scene = scene_of(side, "engine: ode");
    ASSERT_EQ(scene.model.bodies.size(), 5U);
    ASSERT_EQ(scene.model.shapes.size(), 7U);
    const model::State ode = end_of(scene), articulated = end_of(scene_of(side, "engine: articulated"));
    double moved = 0;
    for (std::size_t b = 1; b < ode.bodies.size(); ++b) {
      EXPECT_LT((ode.bodies[b].p - articulated.bodies[b].p).norm(), 5e-4) << scene.model.bodies[b].name;
      EXPECT_LT(ode.bodies[b].q.angularDistance(articulated.bodies[b].q), 0.02) << scene.model.bodies[b].name;
      moved = std::max(moved, (ode.bodies[b].p - scene.model.bodies[b].zero_pose.p).norm());
    }
    EXPECT_GT(moved, 0.02);
  }
}

constexpr const char* kForearm = "../handmodels/forearm.yaml";

// Oracle: two engines, as above; gravity turns forearm and metacarpals.
TEST(ForearmScene, MovesEquallyInBothEngines) {
  for (const char* side : {"right", "left"}) {
    const scene::Scene scene = scene_of(side, "engine: ode", kForearm);
    const model::State ode = end_of(scene),
                       articulated = end_of(scene_of(side, "engine: articulated", kForearm));
    for (std::size_t b = 1; b < ode.bodies.size(); ++b)
      EXPECT_LT((ode.bodies[b].p - articulated.bodies[b].p).norm(), 5e-4) << scene.model.bodies[b].name;
    for (std::size_t i = 0; i < ode.q.size(); ++i) EXPECT_NEAR(ode.q[i], articulated.q[i], 0.02) << i;
    for (std::size_t j = 0; j < scene.model.joints.size(); ++j) {
      const std::string& name = scene.model.joints[j].name;
      if (name.ends_with("_cmc") || name.ends_with("forearm")) {
        EXPECT_GT(std::abs(ode.q[static_cast<std::size_t>(scene.model.joints[j].first_dof)]), 1e-4) << name;
      }
    }
  }
}

std::size_t count(const std::string& text, const std::string& what) {
  std::size_t out = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++out;
  return out;
}

// Oracle: the model's own numbers of bodies, coordinates and shapes.
TEST(EveryKindOfRow, IsInEveryExport) {
  if (!test::has_package()) GTEST_SKIP() << "a build without the Python package";
  const scene::Scene scene = scene_of("right", "engine: ode");
  const engine::Settings& settings = scene.spec.solver;
  const std::string mjcf = test::written("mjcf", scene.model, settings);
  EXPECT_EQ(count(mjcf, "<body "), 4U);
  EXPECT_EQ(count(mjcf, "<geom "), 7U);
  EXPECT_EQ(count(mjcf, "<joint name"), 6U);
  const std::string urdf = test::written("urdf", scene.model, settings);
  const std::string osim = test::written("osim", scene.model, settings);
  for (const char* name :
       {"right.palm", "right.index_proximal_carrier", "right.index_proximal", "right.sixth_only"})
    EXPECT_NE(urdf.find(std::string("<link name=\"") + name + "\""), std::string::npos) << name;
  // A capsule is two spheres and a cylinder.
  EXPECT_EQ(count(urdf, "<collision>"), 6U * 3 + 1);
  EXPECT_EQ(count(osim, "<Body name"), 4U);
  EXPECT_EQ(count(osim, "<Cylinder>"), 6U);
  EXPECT_EQ(count(osim, "<Brick>"), 1U);
  for (const std::string* text : {&mjcf, &urdf, &osim})
    EXPECT_NE(text->find("right.index_mcp_rotation.rotation"), std::string::npos);
}

// Oracle: the model's own numbers.
TEST(ForearmScene, IsInEveryExport) {
  if (!test::has_package()) GTEST_SKIP() << "a build without the Python package";
  const scene::Scene scene = scene_of("right", "engine: ode", kForearm);
  const engine::Settings& settings = scene.spec.solver;
  const std::string mjcf = test::written("mjcf", scene.model, settings);
  EXPECT_EQ(count(mjcf, "<body "), 19U);
  EXPECT_EQ(count(mjcf, "<geom "), 22U);
  const std::string urdf = test::written("urdf", scene.model, settings);
  const std::string osim = test::written("osim", scene.model, settings);
  EXPECT_EQ(count(osim, "<Body name"), 19U);
  for (const std::string* text : {&mjcf, &urdf, &osim})
    for (const char* name : {"right.forearm.pronation", "right.ring_cmc.flexion", "right.little_cmc.flexion"})
      EXPECT_NE(text->find(name), std::string::npos) << name;
}

// Oracle: a palm in three bodies meets no more of its own hand than one in one does: at rest, none of the
// straight fingers.
TEST(ForearmScene, HasAPalmThatDoesNotTouchItself) {
  scene::Scene scene = scene::compile_scene(
      parse_yaml("hands: [{model: ../handmodels/forearm.yaml, person: persons/median_man.yaml, side: right, "
                 "wrist: {mount: universal, position: [0, 0, 1]}}]\nduration: 0.05\n"
                 "effects: [joint_stops, passive_tissue, self_contact, friction]\nsolver: {engine: "
                 "articulated, step: 0.001}\n",
                 test::in_source("config/test.yaml")));
  EXPECT_TRUE(scene.warnings.empty());
  Simulation simulation(scene);
  for (long i = 0; i < simulation.step_count(); ++i) {
    simulation.step();
    for (const auto& contact : simulation.engine().contacts())
      for (const int shape : {contact.shape_a, contact.shape_b})
        EXPECT_EQ(scene.model.shapes[static_cast<std::size_t>(shape)].name.find("metacarpal"),
                  std::string::npos);
  }
}

}  // namespace
}  // namespace handsim::simulation
