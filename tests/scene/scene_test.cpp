#include <gtest/gtest.h>

#include <fstream>

#include "handsim/engine/engine.h"
#include "handsim/model/kinematics.h"
#include "handsim/scene/read/blocks.h"
#include "scene_files.h"

namespace handsim::scene {
namespace {

using model::Effect;
using test::shipped_scene;

Scene scene_from(const std::string& text) {
  return compile_scene(parse_yaml(text, test::in_source("config/test.yaml")));
}

std::string with_hand(const std::string& rest) {
  return "hands: [{model: ../handmodels/anatomical.yaml, person: persons/median_man.yaml, side: "
         "right}]\nduration: 1\n" +
         rest;
}

TEST(Scene, ShippedScenesCompile) {
  for (const char* folder : {"config", "config/stability"})
    for (const auto& file : std::filesystem::directory_iterator(test::source(folder))) {
      if (file.path().extension() != ".yaml" || kind_of(load_yaml(file.path())) != FileKind::scene) continue;
      EXPECT_NO_THROW(load_scene(file.path())) << file.path();
    }
}

TEST(Scene, AutoEffectsAreWhatTheContentNeeds) {
  const Scene hand = scene_from(with_hand("effects: auto\n"));
  EXPECT_TRUE(hand.spec.solver.effects.has(Effect::joint_stops));
  EXPECT_TRUE(hand.spec.solver.effects.has(Effect::passive_tissue));
  EXPECT_FALSE(hand.spec.solver.effects.any_contact());
  EXPECT_TRUE(hand.model.contact_rules.empty());
  const Scene ball = scene_from(
      "objects: [{name: ball, shape: sphere, radius: 0.1, mass: 1, position: [0, 0, 1]}]\nground: "
      "{}\nduration: 1\n");
  EXPECT_TRUE(ball.spec.solver.effects.has(Effect::ground_contact));
  EXPECT_TRUE(ball.spec.solver.effects.has(Effect::friction));
  EXPECT_FALSE(ball.spec.solver.effects.has(Effect::joint_stops));
  const std::string text = emit_yaml(ball.resolved);
  EXPECT_NE(text.find("effects: [gravity, object_contact, ground_contact, friction]"), std::string::npos)
      << text;
}

// Oracle: what holds up a plate that falls about a hinge: the palm below it, or the hinge's stop.
TEST(Scene, AHandTouchesABodyOnAHinge) {
  const std::string hand =
      "hands: [{model: ../handmodels/anatomical.yaml, person: persons/median_man.yaml, side: right, wrist: "
      "{mount: fixed, position: [0, 0, 0.2]}}]\n";
  const std::string plate =
      "bodies: [{name: plate, mass: 0.1, inertia: [1e-4, 1e-4, 1e-4], position: [0, 0.09, 0.25], collides: "
      "true, "
      "shape: {kind: box, edges: [0.1, 0.1, 0.004]}}]\n"
      "joints: [{name: hinge, type: hinge, parent: world, child: plate, position: [0, 0.2, 0.25], axes: "
      "[{name: turn, axis: [1, 0, 0], range: [-1, 1.5]}]}]\nsolver: {engine: articulated}\nduration: 1\n";
  const Scene with = scene_from(hand + plate), without = scene_from(plate);
  EXPECT_TRUE(with.spec.solver.effects.has(Effect::object_contact));
  EXPECT_FALSE(without.spec.solver.effects.any_contact());
  const auto turned = [](const Scene& scene) {
    const auto engine = engine::make_engine(scene.model, scene.spec.solver);
    for (int i = 0; i < 1000; ++i) engine->step({});
    return engine->state().q.back();
  };
  EXPECT_NEAR(turned(without), 1.5, 1e-3);
  EXPECT_NEAR(turned(with), 0.25, 0.15);
}

// Oracle: the scene file: a mug of several shapes, and its support, which does not move.
TEST(Scene, TheModelKnowsItsObjects) {
  const Scene scene = shipped_scene("grasp_cup");
  const model::Model& model = scene.model;
  ASSERT_EQ(model.objects.size(), 2U);
  ASSERT_EQ(scene.plans.objects.size(), 2U);
  std::size_t shapes = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    const model::ObjectIndex& object = model.objects[i];
    EXPECT_EQ(object.name, scene.plans.objects[i].name);
    EXPECT_EQ(object.shapes.size(), scene.plans.objects[i].shapes.size());
    EXPECT_EQ(object.body.has_value(), !scene.plans.objects[i].is_static);
    for (const int shape : object.shapes) {
      EXPECT_EQ(model.objects_of_shapes()[static_cast<std::size_t>(shape)], i);
      EXPECT_EQ(model.shapes[static_cast<std::size_t>(shape)].body, object.body.value_or(model::kWorld));
      ++shapes;
    }
  }
  EXPECT_GT(model.objects[0].shapes.size(), 1U);
  EXPECT_EQ(model.bodies[static_cast<std::size_t>(*model.objects[0].body)].name, "mug");
  for (std::size_t i = 0; i < model.shapes.size(); ++i)
    shapes += model.shapes[i].part != model::Part::object && !model.objects_of_shapes()[i] ? 1 : 0;
  EXPECT_EQ(shapes, model.shapes.size());
}

// Oracle: a scene whose hands have files of their own, read where nothing is shared.
TEST(Scene, HandsOfOnePersonAndModelShareBoth) {
  const Scene scene = shipped_scene("two_hands");
  EXPECT_EQ(scene.spec.hands[0].model, scene.spec.hands[1].model);
  Diagnostics diagnostics;
  YamlNode tree = load_yaml(test::source("handmodels/anatomical.yaml"));
  tree.entries.remove_if([](const YamlEntry& entry) { return entry.key == "muscles"; });
  const hand::HandSpec own = hand::read_hand_spec(tree, "", diagnostics);
  const hand::BuiltHand built = hand::build_hand(own, scene.spec.hands[1].person);
  ASSERT_EQ(built.bodies.size(), scene.hands[1].bodies.size());
  for (std::size_t i = 0; i < built.bodies.size(); ++i) {
    EXPECT_EQ(built.bodies[i].mass, scene.hands[1].bodies[i].mass);
    EXPECT_EQ(built.bodies[i].inertia, scene.hands[1].bodies[i].inertia);
  }
}

// Oracle: the same scene from its own text, whose trees nobody has seen before.
TEST(Scene, AnotherPersonBesideAKnownModelIsAsInAFreshFile) {
  const Scene known = shipped_scene("two_hands");
  YamlNode root = known.resolved;
  apply_override(root, "hands.1.person.stature=1.6");
  const Scene changed = compile_scene(root);
  EXPECT_EQ(changed.spec.hands[0].model, known.spec.hands[0].model);
  const Scene fresh = compile_scene(parse_yaml(emit_yaml(root), "fresh.yaml"));
  EXPECT_NE(fresh.spec.hands[0].model, known.spec.hands[0].model);
  EXPECT_EQ(emit_yaml(changed.resolved), emit_yaml(fresh.resolved));
  ASSERT_EQ(changed.model.bodies.size(), fresh.model.bodies.size());
  for (std::size_t i = 0; i < fresh.model.bodies.size(); ++i) {
    EXPECT_EQ(changed.model.bodies[i].mass, fresh.model.bodies[i].mass);
    EXPECT_EQ(changed.model.bodies[i].inertia, fresh.model.bodies[i].inertia);
    EXPECT_EQ(changed.model.bodies[i].zero_pose.p, fresh.model.bodies[i].zero_pose.p);
  }
  EXPECT_NE(changed.model.bodies[1].mass, changed.model.bodies[17].mass);
}

// A hand model that names a file is read again: the file may have changed.
TEST(Scene, AFileThatAHandModelNamesIsReadEachTime) {
  const auto folder = std::filesystem::temp_directory_path() / "handsim_shared_model";
  std::filesystem::create_directories(folder);
  for (const char* name : {"anatomical.yaml", "anthropometry.yaml", "grip_strength.yaml", "muscles.yaml"})
    std::filesystem::copy_file(test::source(std::string("handmodels/") + name), folder / name,
                               std::filesystem::copy_options::overwrite_existing);
  const auto length = [&] {
    Diagnostics diagnostics;
    YamlNode tree = load_yaml(folder / "anatomical.yaml");
    const auto spec = hand::shared_hand_spec(tree, "", diagnostics);
    diagnostics.throw_if_any();
    return hand::hand_size(spec->anthropometry, hand::Person{}).length;
  };
  const double before = length();
  EXPECT_EQ(length(), before);
  YamlNode changed = load_yaml(folder / "anthropometry.yaml");
  changed.find("fits")->find("pooled")->find("hand_length")->find("smearing")->text = "1.5";
  std::ofstream(folder / "anthropometry.yaml") << emit_yaml(changed);
  EXPECT_NE(length(), before);
  std::filesystem::remove_all(folder);
}

TEST(Scene, ResolvedTextIsAFixedPoint) {
  const Scene once = shipped_scene("two_hands");
  const Scene twice = compile_scene(parse_yaml(emit_yaml(once.resolved), "resolved.yaml"));
  EXPECT_EQ(emit_yaml(once.resolved), emit_yaml(twice.resolved));
}

// Oracle: the text: the hand is in line 2, an object of the hand's name in line 3.
TEST(Scene, KeepsThePlaceOfAProblemWithItsPart) {
  try {
    scene_from(
        "hands:\n  - {model: ../handmodels/anatomical.yaml, person: persons/median_man.yaml, side: right, "
        "pose: "
        "{index_pip: -1.2}}\n"
        "objects: [{name: right, shape: sphere, radius: 0.01, mass: 1, position: [0, 0, 9]}]\nduration: 1\n");
    FAIL() << "a joint that starts beyond its stop";
  } catch (const Error& error) {
    ASSERT_EQ(error.problems().size(), 1U) << error.what();
    EXPECT_EQ(error.problems()[0].key, "right.index_pip.flexion");
    EXPECT_EQ(error.problems()[0].place->line, 2);
  }
}

TEST(Scene, OverridesReachIntoReferencedFiles) {
  const Scene scene = shipped_scene("two_hands", {"hands.0.person.stature=1.6", "solver.step=2 ms"});
  EXPECT_EQ(scene.spec.hands[0].person.stature, 1.6);
  EXPECT_EQ(scene.spec.hands[1].person.stature, 1.755);
  EXPECT_EQ(scene.spec.solver.step, 0.002);
}

TEST(Scene, PersonsOutsideTheSurveyAreWarnedOf) {
  const auto with = [](const char* name) {
    const std::string person = test::source(std::string("config/persons/") + name + ".yaml").string();
    return shipped_scene("two_hands", {"hands.0.person=" + person});
  };
  EXPECT_TRUE(with("child").warnings.empty());
  const Scene giant = with("giant");
  ASSERT_EQ(giant.warnings.size(), 1U);
  EXPECT_NE(giant.warnings[0].find("2.1 m is outside the survey (1.409 to 1.993 m) by 0.107 m"),
            std::string::npos)
      << giant.warnings[0];
}

TEST(Scene, StartPoseAndTissueScaleReachTheModel) {
  const Scene scene = scene_from(
      "hands: [{model: ../handmodels/anatomical.yaml, person: persons/median_man.yaml, side: left,"
      " pose: {index_mcp: [0.5, \"5 deg\"], ring_dip: 0.25}, tissue: {stiffness: 2, damping: 0}}]\nduration: "
      "1\n");
  bool seen = false;
  for (const model::Joint& joint : scene.model.joints) {
    if (joint.name != "left.index_mcp") continue;
    seen = true;
    EXPECT_EQ(joint.axes[0].initial, 0.5);
    EXPECT_NEAR(joint.axes[1].initial, 5 * M_PI / 180, 1e-15);
    EXPECT_EQ(joint.axes[0].tissue->stiffness, 2 * 0.039);
    EXPECT_EQ(joint.axes[0].tissue->damping, 0);
  }
  EXPECT_TRUE(seen);
}

TEST(Scene, ADrivenWristStartsOnItsTrajectory) {
  const Scene scene = scene_from(
      "hands: [{model: ../handmodels/anatomical.yaml, person: persons/median_man.yaml, side: right, wrist: "
      "{mount: driven,"
      " motion: {keyframes: [{time: 0, position: [1, 2, 3]}, {time: 1, position: [1, 2, 4]}]}}}]\nduration: "
      "1\n");
  ASSERT_EQ(scene.model.drives.size(), 1U);
  const model::State start = model::initial_state(scene.model);
  const model::HandIndex& hand = scene.model.hands[0];
  EXPECT_LT(
      (start.bodies[static_cast<std::size_t>(hand.palm)].pose() * hand.wrist_frame.p - Vec3(1, 2, 3)).norm(),
      1e-14);
}

}  // namespace
}  // namespace handsim::scene
