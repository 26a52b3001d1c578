#include <cmath>

#include <gtest/gtest.h>

#include "handsim/hand/build.h"
#include "handsim/model/elastic_lanes.h"
#include "handsim/model/kinematics.h"
#include "scene_files.h"

namespace handsim::hand {
namespace {

HandSpec shipped() {
  YamlNode root = load_yaml(test::source("handmodels/anatomical.yaml"));
  Diagnostics diagnostics;
  HandSpec spec = read_hand_spec(root, "", diagnostics);
  diagnostics.throw_if_any();
  return spec;
}

Person person(double stature, double mass, Sex sex, double age = 30) {
  Person out;
  out.stature = stature;
  out.mass = mass;
  out.sex = sex;
  out.age = age;
  return out;
}

const model::Muscle& muscle(const BuiltHand& hand, const std::string& name) {
  for (const model::Muscle& each : hand.muscles.muscles)
    if (each.name == name) return each;
  throw std::runtime_error(name);
}

/// Coordinates of a hand with given angles, in degrees.
std::vector<double> pose(const BuiltHand& hand, const std::map<std::string, double>& degrees) {
  std::vector<double> q(hand.axes.size());
  for (std::size_t i = 0; i < q.size(); ++i)
    if (const auto found = degrees.find(hand.axes[i].name); found != degrees.end())
      q[i] = found->second * M_PI / 180;
  return q;
}

// Oracle: the row of Ketchum 1978 and MyoHand at 0 degrees, 10.1 and 9.6 mm, on the file's own hand.
TEST(HandMuscles, HaveTheArmsOfTheFileOnTheFilesHand) {
  const HandSpec spec = shipped();
  Person reference = person(1.75, 72, Sex::male);
  reference.hand_length = spec.muscles->hand_length;
  const BuiltHand hand = build_hand(spec, reference);
  const model::Muscle& fdp = muscle(hand, "FDP2");
  const model::PathState at = path_state(fdp.path, pose(hand, {}));
  double arm = 0;
  for (std::size_t i = 0; i < fdp.path.arms.size(); ++i)
    if (hand.axes[static_cast<std::size_t>(fdp.path.arms[i].dof)].name == "index_mcp.flexion")
      arm = at.arm[i];
  EXPECT_NEAR(arm, 0.0097, 0.0006);
}

// A force across the last segment has moments of the DIP and the PIP in the ratio of their distances to its
// line, L3 and L3 + L2 cos(DIP). Oracle: of a fingertip, 0.41; the slips give it where the PIP is flexed and
// the DIP nearly straight, and more of the DIP's in a straight finger, in which the slips share evenly.
TEST(HandMuscles, SlipsOfTheLongExtensorShareByPosture) {
  const BuiltHand hand = build_hand(shipped(), person(1.75, 72, Sex::male));
  const auto ratio = [&](double mcp, double pip, double dip) {
    const model::TendonPath& path = muscle(hand, "EDC2").path;
    const model::PathState at = path_state(
        path,
        pose(hand, {{"index_mcp.flexion", mcp}, {"index_pip.flexion", pip}, {"index_dip.flexion", dip}}));
    std::map<std::string, double> arm;
    for (std::size_t i = 0; i < path.arms.size(); ++i)
      arm[hand.axes[static_cast<std::size_t>(path.arms[i].dof)].name] = at.arm[i];
    EXPECT_LT(arm["index_pip.flexion"], 0);
    return arm["index_dip.flexion"] / arm["index_pip.flexion"];
  };
  EXPECT_NEAR(ratio(45, 45, 10), 0.097 / (0.097 + 0.143 * std::cos(M_PI / 18)), 0.05);
  EXPECT_GT(ratio(0, 0, 0), ratio(45, 45, 10) + 0.05);
  EXPECT_GT(ratio(45, 45, 45), ratio(45, 45, 10));
}

// Oracle: lengths scale with hand length, forces with strength.
TEST(HandMuscles, ScaleWithHandLengthAndGripStrength) {
  const HandSpec spec = shipped();
  Person small = person(1.75, 72, Sex::male), large = small;
  small.hand_length = 0.16;
  large.hand_length = 0.20;
  small.grip_strength = 200;
  large.grip_strength = 600;
  const BuiltHand a = build_hand(spec, small), b = build_hand(spec, large);
  for (std::size_t i = 0; i < a.muscles.muscles.size(); ++i) {
    const model::Muscle &x = a.muscles.muscles[i], &y = b.muscles.muscles[i];
    EXPECT_NEAR(y.force / x.force, 3, 1e-12);
    EXPECT_NEAR(y.fibre_length / x.fibre_length, 1.25, 1e-12);
    EXPECT_NEAR(path_state(y.path, pose(b, {{"index_mcp.flexion", 40}})).excursion,
                1.25 * path_state(x.path, pose(a, {{"index_mcp.flexion", 40}})).excursion, 1e-15);
  }
}

// Oracle: grip of a man of 30 years and 1.75 m in the norm, 524.7 N, over the file's; of a newborn the
// smallest stature's, 501.1 N, times (0.5 / 1.6)^2.
TEST(HandMuscles, AreTheStrengthOfThePerson) {
  const HandSpec spec = shipped();
  const BuiltHand man = build_hand(spec, person(1.75, 72, Sex::male));
  EXPECT_NEAR(man.muscles.strength, 524.7 / 520.34, 1e-12);
  const double newborn = build_hand(spec, person(0.5, 3.5, Sex::male)).muscles.strength;
  EXPECT_NEAR(newborn, 501.1 / 520.34 * 0.3125 * 0.3125, 1e-12);
}

// Oracle: fibres are at their optimal length at the joints' rest angles, by the file's definition.
TEST(HandMuscles, HaveOptimalFibresAtTheRestAngles) {
  const BuiltHand hand = build_hand(shipped(), person(1.75, 72, Sex::male));
  std::vector<double> rest;
  for (const HandAxis& axis : hand.axes) rest.push_back(axis.rest);
  for (const model::Muscle& each : hand.muscles.muscles) {
    const double along = each.length - path_state(each.path, rest).excursion - each.slack_length;
    const double across = each.fibre_length * std::sin(each.pennation);
    EXPECT_NEAR(std::hypot(along, across), each.fibre_length, 1e-12) << each.name;
  }
}

// Oracle: a mount without a wrist joint has no arms about it; a left hand has the same arms as a right one.
TEST(HandMuscles, LoseTheAxesThatTheMountOmits) {
  const BuiltHand hand = build_hand(shipped(), person(1.75, 72, Sex::male));
  model::Model fixed = model::make_model(), moving = model::make_model();
  Placement placement;
  add_hand(fixed, hand, placement);
  placement.mount = Mount::universal;
  placement.side = model::Side::left;
  placement.name = "left";
  add_hand(moving, hand, placement);
  const auto arms = [](const model::Model& model, const std::string& name) {
    for (const model::Muscle& each : model.muscles)
      if (each.name == name) return each.path.arms;
    return std::vector<model::MomentArm>();
  };
  EXPECT_EQ(arms(fixed, "right.FCR").size(), 0u);
  EXPECT_EQ(arms(moving, "left.FCR").size(), 2u);
  const auto right = arms(fixed, "right.FDP3"), left = arms(moving, "left.FDP3");
  ASSERT_EQ(left.size(), right.size() + 2);
  for (std::size_t i = 0; i < right.size(); ++i) {
    EXPECT_EQ(left[i + 2].c, right[i].c);
    EXPECT_EQ(left[i + 2].dof, right[i].dof + 2);
  }
}

// Oracle: what tendons say of each muscle alone at the new angles and at no speed.
TEST(HandMuscles, AreAtRestWhereJointsArePlaced) {
  const BuiltHand hand = build_hand(shipped(), person(1.75, 72, Sex::male));
  for (const std::optional<double> strain : {std::optional<double>(), std::optional<double>(0.049)}) {
    model::Model model = model::make_model();
    Placement placement;
    placement.tendon_strain = strain;
    add_hand(model, hand, placement);
    model::State state = model::initial_state(model);
    std::fill(state.activation.begin(), state.activation.end(), 0.4);
    const std::vector<double> q(state.q.size(), 0.5), u(state.q.size(), 3.0);
    model::place_joints(model, q, u, state);
    for (std::size_t i = 0; i < model.muscles.size(); ++i) {
      const model::Muscle& each = model.muscles[i];
      const double excursion = path_state(each.path, state.q).excursion;
      const double taut = each.length - excursion - each.slack_length;
      const double across = each.fibre_length * std::sin(each.pennation);
      const double reach = std::sqrt(std::pow(state.fibre_length[i], 2) - across * across);
      const double own =
          model::tension(each, model::fibre_excursion(each, state.fibre_length[i]), 0, 0.4).force;
      EXPECT_NEAR(state.tendon_force[i], own, 1e-9 * each.force) << each.name;
      const double stretch = strain ? *strain * each.slack_length : 0;
      const double tendon = strain ? each.force * model::tendon_curve((taut - reach) / stretch).value : own;
      EXPECT_NEAR(state.tendon_force[i], tendon, 1e-9 * each.force) << each.name;
      EXPECT_NEAR(reach, taut, strain ? stretch : 1e-12) << each.name;
    }
  }
}

TEST(HandMuscles, NameEveryMistakeOfTheirFile) {
  YamlNode root = parse_yaml(R"(title: t
reference: {hand_length: "178 mm", grip_strength: 520}
norms: {title: t, source: s, norms: [{sex: male, age: [1, 99], stature: [1, 2], mean: 500, deviation: 80},
  {sex: female, age: [1, 99], stature: [1, 2], mean: 300, deviation: 60}]}
muscles:
  - {name: A, force: 10, fibre: "50 mm", tendon: "0.2 m", arms: {index_mcp.flexon: 0.01}}
  - {name: A, force: -1, fibre: "50 mm", tendon: "0.2 m", arms: {wrist.flexion: [0.01, 1, 2, 3, 4, 5]}}
bands:
  - {name: B, between: [A, C], stiffness: 1, damping: 1}
common_drive: [A, A, D]
nerves: {n: {A: 1}}
feeling: {m: {index: 1}, n: {thumb: 1}}
)",
                             "muscles.yaml");
  Diagnostics diagnostics;
  const std::vector<HandAxis> axes = {{"index_mcp.flexion", 0, 1, 0}, {"wrist.flexion", 0, 1, 0}};
  read_muscle_file(root, "muscles", axes, diagnostics);
  std::string text;
  for (const Problem& each : diagnostics.problems)
    text += each.key + ": got " + each.got + ", need " + each.need + "\n";
  for (const char* part :
       {"index_mcp.flexon", "index_mcp.flexion", "A a second time", "muscles.1.force", "6 coefficients",
        "between: got C", "common_drive: got A a second time",
        "common_drive: got D, need a muscle of this file", "feeling.m: got m, need one of nerves",
        "feeling.n.thumb: got thumb, need a finger"})
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
}

}  // namespace
}  // namespace handsim::hand
