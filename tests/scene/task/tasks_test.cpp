// Planning of tasks does not change the scene; two tasks may share an object if they agree on its pose.
#include "handsim/scene/task/tasks.h"

#include <regex>

#include <gtest/gtest.h>

#include "scene_files.h"

namespace handsim::scene {
namespace {

/// Hands of one man with this mount, and a controller.
std::string hands(const std::string& mount, const std::vector<std::string>& sides) {
  std::string text = "hands:\n";
  for (const std::string& side : sides)
    text += "  - {model: ../handmodels/anatomical.yaml, person: persons/median_man.yaml, side: " + side +
            ", wrist: {mount: " + mount + "}}\n";
  return text +
         "control: {controller: ../controllers/climb.yaml, poses: {unit: deg, poses: {flat: "
         "{thumb_cmc: [-32, -22]}}}}\n";
}

std::string grasp(const std::string& hand, double x, const std::string& more) {
  return "  - {hand: " + hand + ", object: ball, wrist: {position: [" + std::to_string(x) +
         ", 0, 0.5]}, at: {position: [" + std::to_string(-x) +
         ", 0.1, 0]}, open: flat, closed: flat, approach: {from: [0, -0.1, 0]}, " + more + "}\n";
}

const std::string kBall = "objects: [{name: ball, shape: sphere, radius: 0.03, mass: 0.1}]\n";

std::string climb(const std::string& hand, double close) {
  return "  - {hand: " + hand + ", hold: bar, wrist: {position: [0.1, 0, 0.5]}, open: flat, closed: flat, " +
         "close: " + std::to_string(close) + ", strength: ../handmodels/grip_strength.yaml}\n";
}

std::string bar_at(double x) {
  return "objects: [{name: bar, shape: capsule, radius: 0.01, length: 0.1, static: true, position: [" +
         std::to_string(x) + ", 0.1, 0.5], rotation: {axis: [1, 0, 0], angle: 1}}]\n";
}

Scene compiled(const std::string& text) {
  return compile_scene(parse_yaml(text, test::in_source("config/test.yaml")));
}

/// The error message of a scene; empty if it compiles.
std::string refusal(const std::string& text) {
  try {
    compiled(text);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

bool mentions(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

// Oracle: the text.
TEST(Tasks, DoNotChangeTheScene) {
  const Scene scene = compiled(hands("driven", {"left"}) + kBall + "grasps:\n" +
                               grasp("left", 0.2, "support: {radius: 0.01}"));
  EXPECT_TRUE(scene.spec.hands[0].placement.motion.keys.empty());
  EXPECT_TRUE(scene.spec.hands[0].placement.start.empty());
  ASSERT_EQ(scene.spec.objects.size(), 1U);
  EXPECT_EQ(scene.spec.objects[0].pose.p, Vec3(0, 0, 0));
  EXPECT_TRUE(scene.spec.control->poses->programs.empty());
  EXPECT_TRUE(scene.spec.control->programs[0].program.empty());

  EXPECT_EQ(scene.plans.hands[0].motion.keys.size(), 4U);
  ASSERT_EQ(scene.plans.objects.size(), 2U);
  EXPECT_EQ(scene.plans.objects[0].pose.p, Vec3(0, 0.1, 0.5));
  EXPECT_EQ(scene.plans.objects[1].name, "ball_post");
}

// Oracle: mirror symmetry: a ball in the mirror plane is at one place for both hands.
TEST(Tasks, OfTwoHandsMayShareAnObjectIfTheyAgree) {
  const Scene scene = compiled(hands("driven", {"right", "left"}) + kBall + "grasps:\n" +
                               grasp("right", 0.2, "support: {radius: 0.01}, close: 0.2") +
                               grasp("left", 0.2, "support: ground, close: 0.4"));
  EXPECT_EQ(scene.plans.objects[0].pose.p, Vec3(0, 0.1, 0.5));
  ASSERT_EQ(scene.plans.grasps.size(), 2U);
  // Each hand has its own program: closing takes 0.2 s and 0.4 s, and 0.3 s pass before the lift.
  EXPECT_NEAR(scene.plans.grasps[0].phase("close")->end, 1.0, 1e-12);
  EXPECT_NEAR(scene.plans.grasps[1].phase("close")->end, 1.2, 1e-12);
  for (const std::size_t hand : {0U, 1U})
    EXPECT_NEAR(scene.control->hands[hand].trajectory.phases().back().arrive, hand == 0 ? 0.7 : 0.9, 1e-12);
}

TEST(Tasks, OfOneObjectAtTwoPlacesAreRefusedAtTheSecondTask) {
  const std::string text = refusal(hands("driven", {"right", "left"}) + kBall + "grasps:\n" +
                                   grasp("right", 0.2, "support: ground") +
                                   "  - {hand: left, object: ball, wrist: {position: [0, 0, 0.5]}, at: "
                                   "{position: [0, 0.2, 0]}, support: ground, open: flat, closed: flat}\n");
  EXPECT_TRUE(mentions(text, "test.yaml:8:5: grasps.1.object: got a pose of ball 0.1 m")) << text;
}

// Oracle: mirror symmetry, as above; the hold is at the same pose for both left hands.
TEST(Tasks, MirrorAHoldOnceForAllLeftHands) {
  const Scene scene = compiled(hands("rail", {"left", "left"}) + bar_at(0.2) + "climbs:\n" +
                               climb("left", 0.2) + climb("left2", 0.4));
  EXPECT_EQ(scene.plans.objects[0].pose.p, Vec3(-0.2, 0.1, 0.5));
  EXPECT_EQ(scene.plans.hands[0].pose.p, Vec3(-0.1, 0, 0.5));
  EXPECT_EQ(scene.plans.hands[1].pose.p, Vec3(-0.1, 0, 0.5));
  for (const std::size_t hand : {0U, 1U})
    EXPECT_NEAR(scene.control->hands[hand].trajectory.phases().back().arrive, hand == 0 ? 0.7 : 0.9, 1e-12);
}

TEST(Tasks, OfBothSidesShareAHoldInTheMirrorPlaneOnly) {
  const auto both = [](double x) {
    return hands("rail", {"right", "left"}) + bar_at(x) + "climbs:\n" + climb("right", 0.2) +
           climb("left", 0.2);
  };
  EXPECT_EQ(compiled(both(0)).plans.objects[0].pose.p, Vec3(0, 0.1, 0.5));
  const std::string text = refusal(both(0.2));
  EXPECT_TRUE(mentions(text, "test.yaml:8:5: climbs.1.hold: got a pose of bar 0.4 m")) << text;
}

TEST(Tasks, OfAHandThatHasATaskAreRefused) {
  const std::string text =
      refusal(hands("rail", {"right"}) + bar_at(0) + "climbs:\n" + climb("right", 0.2) + climb("right", 0.2));
  EXPECT_TRUE(mentions(text, "climbs.1.hand: got a hand that climbs.0 moves")) << text;
}

// Oracle: a title stands over whatever a key has made of its scene: it names no quantity.
TEST(ShippedTitles, NameNoQuantityThatAKeyCanChange) {
  const std::regex quantity("(^|\n)title:[^\n]*[0-9] ?(mm|cm|m|g|kg|ms|s|N|Hz|deg|rad/s)\\b[^\n]*");
  int titles = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(test::source("config"))) {
    if (entry.path().extension() != ".yaml") continue;
    const std::string text = test::text_of(entry.path());
    std::smatch found;
    EXPECT_FALSE(std::regex_search(text, found, quantity)) << entry.path() << ": " << found.str();
    titles += text.find("title:") != std::string::npos ? 1 : 0;
  }
  EXPECT_GT(titles, 50);
}

}  // namespace
}  // namespace handsim::scene
