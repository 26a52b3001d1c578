// The shipped poses: their angles over time, and that their geometry matches their names. Oracles: geometry
// of the built hand's capsules, and ODE's collision detection.
#include "handsim/control/poses.h"

#include <gtest/gtest.h>

#include <cmath>

#include "handsim/engine/collision/overlap.h"
#include "handsim/model/kinematics.h"
#include "scene_files.h"

namespace handsim::control {
namespace {

constexpr const char* kFingers[] = {"index", "middle", "ring", "little"};
constexpr const char* kNames[] = {"open",      "rest",      "fist",        "point",           "pinch",
                                  "tripod",    "hook",      "half_crimp",  "open_hand_crimp", "thumb_up",
                                  "count_one", "count_two", "count_three", "count_four",      "count_five"};

/// A capsule's axis in the hand frame, from its proximal to its distal end.
struct Segment {
  Vec3 from, to;
  double radius = 0;
  Vec3 direction() const { return (to - from).normalized(); }
};

/// The nearest points of two capsules: their gap [m] and the positions along the axes, 0..1.
struct Nearest {
  double gap = 1;
  double a = 0, b = 0;
};

Nearest nearest(const Segment& a, const Segment& b) {
  constexpr int kPoints = 200;
  Nearest out;
  for (int i = 0; i <= kPoints; ++i)
    for (int j = 0; j <= kPoints; ++j) {
      const double u = static_cast<double>(i) / kPoints, v = static_cast<double>(j) / kPoints;
      const double gap =
          (a.from + u * (a.to - a.from) - b.from - v * (b.to - b.from)).norm() - a.radius - b.radius;
      if (gap < out.gap) out = {gap, u, v};
    }
  return out;
}

/// The right hand of the pose scene, put into its poses without simulation.
struct Posed {
  explicit Posed(const std::vector<std::string>& overrides = {})
      : scene(test::shipped_scene("every_pose", overrides)),
        axes(hand_axes(scene.model, scene.model.hands[0])) {}

  model::State at(const std::string& pose) const {
    const Trajectory& trajectory = scene.control->hands[0].trajectory;
    std::vector<double> angles(axes.axes.size()), q(static_cast<std::size_t>(scene.model.dof_count()));
    for (const Phase& phase : trajectory.phases())
      if (phase.pose == pose) trajectory.at(phase.arrive + 1e-6, angles);
    for (std::size_t i = 0; i < angles.size(); ++i) q[axes.axes[i].dof] = angles[i];
    return model::state_at(scene.model, q);
  }
  Segment segment(const model::State& state, const std::string& name) const {
    const model::HandIndex& hand = scene.model.hands[0];
    const Pose frame = state.bodies[static_cast<std::size_t>(hand.palm)].pose() * hand.wrist_frame;
    for (const model::Shape& shape : scene.model.shapes) {
      if (shape.name != "right." + name) continue;
      const Pose pose =
          frame.inverse() * (state.bodies[static_cast<std::size_t>(shape.body)].pose() * shape.pose);
      const Vec3 half = pose.q * Vec3(0, 0, shape.length / 2);
      return {pose.p - half, pose.p + half, shape.radius};
    }
    ADD_FAILURE() << "no shape " << name;
    return {};
  }
  /// Gap between the surfaces of a fingertip and the middle of the palm along the palm's normal [m].
  double tip_above_palm(const model::State& state, const std::string& finger) const {
    const Segment tip = segment(state, finger + "_distal");
    double thickness = 0;
    for (const model::Shape& shape : scene.model.shapes)
      if (shape.name == "right.palm.middle") thickness = 2 * shape.radius;
    return -tip.to.z() - tip.radius - thickness / 2;
  }
  bool straight(const model::State& state, const std::string& digit) const {
    return segment(state, digit + "_proximal")
               .direction()
               .dot(segment(state, digit + "_distal").direction()) > std::cos(10 * kDegree);
  }
  /// Deepest overlap of any two parts of the right hand [m].
  double overlap(const model::State& state) const {
    double deepest = 0;
    for (const engine::Overlap& found : engine::initial_overlaps(scene.model, state))
      deepest = std::max(deepest, found.depth);
    return deepest;
  }

  scene::Scene scene;
  HandAxes axes;
};

TEST(Poses, OfTheShippedFilesAreComplete) {
  const auto names = [](const char* path) {
    YamlNode root = load_yaml(test::source(path));
    Diagnostics diagnostics;
    const PoseFile file = read_pose_file(root, "", diagnostics);
    EXPECT_TRUE(diagnostics.problems.empty());
    std::vector<std::string> out;
    for (const auto& [name, pose] : file.poses) out.push_back(name);
    return out;
  };
  std::vector<std::string> expected(std::begin(kNames), std::end(kNames));
  std::sort(expected.begin(), expected.end());
  EXPECT_EQ(names("controllers/poses.yaml"), expected);
  EXPECT_EQ(names("controllers/prototype_poses.yaml"), (std::vector<std::string>{"fist", "open", "test"}));
}

TEST(Poses, AreTheSameAnglesOnBothHands) {
  const scene::Scene scene = test::shipped_scene("every_pose");
  std::vector<double> right(20), left(20);
  for (double t = 0; t < 18; t += 0.1) {
    scene.control->hands[0].trajectory.at(t, right);
    scene.control->hands[1].trajectory.at(t, left);
    EXPECT_EQ(right, left);
  }
}

/// Angle of the right index PIP at a time of a scene's program [deg].
double index_pip(const scene::Scene& scene, double time, std::size_t hand = 0) {
  const HandAxes axes = hand_axes(scene.model, scene.model.hands[hand]);
  const auto at = std::find_if(axes.axes.begin(), axes.axes.end(),
                               [](const HandAxis& a) { return a.joint == "index_pip"; });
  std::vector<double> q(axes.axes.size());
  scene.control->hands[hand].trajectory.at(time, q);
  return q[static_cast<std::size_t>(at - axes.axes.begin())] / kDegree;
}

// Oracle: the minimum-jerk polynomial 10 s^3 - 15 s^4 + 6 s^5 and the straight line, from rest (30 deg) at
// 2.4 s to fist (98 deg) half a second later.
TEST(Programs, MoveAlongMinimumJerkOrLinesAndHold) {
  const scene::Scene smooth = test::shipped_scene("every_pose");
  const scene::Scene straight =
      test::shipped_scene("every_pose", {"control.poses.programs.every_pose.interpolation=linear"});
  for (const double s : {0.0, 0.1, 0.25, 0.5, 0.8, 1.0}) {
    const double fraction = s * s * s * (10 - 15 * s + 6 * s * s);
    EXPECT_NEAR(index_pip(smooth, 2.4 + 0.5 * s), 30 + 68 * fraction, 1e-9);
    EXPECT_NEAR(index_pip(straight, 2.4 + 0.5 * s), 30 + 68 * s, 1e-9);
  }
  for (const double t : {2.9, 3.2, 3.6}) EXPECT_NEAR(index_pip(smooth, t), 98, 1e-9) << t;
}

TEST(Programs, MayDifferFromHandToHand) {
  const scene::Scene scene = test::shipped_scene(
      "every_pose",
      {"control.poses.programs.every_pose={hands: {right: [{time: 0, pose: fist}], left: [{time: "
       "0, pose: hook}]}}"});
  EXPECT_NEAR(index_pip(scene, 1, 0), 98, 1e-9);
  EXPECT_NEAR(index_pip(scene, 1, 1), 90, 1e-9);
}

class EachPose : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, EachPose, ::testing::ValuesIn(kNames));

// 0.4 mm: the angles are rounded to half degrees. With other proportions the segments overlap more.
TEST_P(EachPose, PassesNoFingerThroughAnotherOrThePalm) {
  const Posed man;
  EXPECT_LT(man.overlap(man.at(GetParam())), 0.4e-3);
  const Posed child({"hands.0.person.stature=1.1", "hands.0.person.mass=18"});
  EXPECT_LT(child.overlap(child.at(GetParam())), 2e-3);
  const Posed giant({"hands.0.person.stature=2.1", "hands.0.person.mass=140"});
  EXPECT_LT(giant.overlap(giant.at(GetParam())), 2e-3);
}

TEST(Poses, PinchAndTripodMeetAtTheFingertips) {
  const Posed hand;
  const auto meets = [&](const char* pose, const char* finger) {
    const model::State state = hand.at(pose);
    const Nearest at =
        nearest(hand.segment(state, "thumb_distal"), hand.segment(state, std::string(finger) + "_distal"));
    EXPECT_LT(std::abs(at.gap), 0.5e-3) << pose << " " << finger;
    EXPECT_GT(at.a, 0.8) << pose << " " << finger;
    EXPECT_GT(at.b, 0.6) << pose << " " << finger;
  };
  meets("pinch", "index");
  meets("tripod", "index");
  meets("tripod", "middle");
  const model::State pinch = hand.at("pinch");
  EXPECT_GT(nearest(hand.segment(pinch, "thumb_distal"), hand.segment(pinch, "middle_distal")).gap, 0.02);
}

// The joints' ranges leave the fingertips some millimetres above the flat palm; the fist is within 4 mm of
// what they allow, and the thumb lies on the index and middle finger.
TEST(Poses, FistIsClosedUnderTheThumb) {
  const Posed hand;
  const model::State fist = hand.at("fist");
  std::vector<double> q(static_cast<std::size_t>(hand.scene.model.dof_count()));
  for (const HandAxis& axis : hand.axes.axes)
    if (axis.axis == "flexion") q[axis.dof] = axis.stop->high;
  const model::State closed = model::state_at(hand.scene.model, q);
  for (const char* finger : kFingers) {
    const double gap = hand.tip_above_palm(fist, finger);
    EXPECT_GT(gap, 0) << finger;
    EXPECT_LT(gap, hand.tip_above_palm(closed, finger) + 4e-3) << finger;
  }
  EXPECT_LT(nearest(hand.segment(fist, "thumb_proximal"), hand.segment(fist, "index_middle")).gap, 2e-3);
  EXPECT_LT(nearest(hand.segment(fist, "thumb_distal"), hand.segment(fist, "middle_middle")).gap, 2e-3);
}

TEST(Poses, ThumbUpPointsTheThumbAwayFromAFist) {
  const Posed hand;
  const model::State state = hand.at("thumb_up");
  const Vec3 thumb =
      (hand.segment(state, "thumb_distal").to - hand.segment(state, "thumb_metacarpal").from).normalized();
  EXPECT_GT(thumb.dot(-Vec3::UnitX()), std::cos(20 * kDegree));
  for (const char* finger : kFingers) EXPECT_FALSE(hand.straight(state, finger));
}

TEST(Poses, CountsHoldUpThatManyFingers) {
  const Posed hand;
  int number = 0;
  for (const char* pose : {"count_one", "count_two", "count_three", "count_four", "count_five"}) {
    const model::State state = hand.at(pose);
    int up = hand.straight(state, "thumb") ? 1 : 0;
    for (const char* finger : kFingers) up += hand.straight(state, finger) ? 1 : 0;
    EXPECT_EQ(up, ++number) << pose;
  }
}

// Half crimp: PIP at about a right angle, DIP hardly flexed; hook: straight MCP, bent PIP and DIP; open hand:
// PIP flexed less than a right angle.
TEST(Poses, GripsBendTheJointsThatTheyAreNamedFor) {
  const scene::Scene scene = test::shipped_scene("every_pose");
  EXPECT_NEAR(index_pip(scene, 9.5), 90, 1e-9);  // half_crimp
  EXPECT_NEAR(index_pip(scene, 8.3), 90, 1e-9);  // hook
  EXPECT_LT(index_pip(scene, 10.7), 45);         // open_hand_crimp
}

}  // namespace
}  // namespace handsim::control
