// Hands that differ from what is predicted by deviations of their person.
#include "handsim/hand/deviations.h"

#include <gtest/gtest.h>

#include <cmath>

#include "hand/shipped_hands.h"
#include "handsim/hand/build.h"
#include "handsim/hand/doubts.h"

namespace handsim::hand {
namespace {

// Oracle: the model's numbers. A measured length stays, and breadth moves by its conditional deviation alone.
TEST(Deviations, MoveWhatIsNotMeasuredByItsSpread) {
  const HandSpec spec = shipped("anatomical");
  Person one = person(1.75, 72, Sex::male);
  const BuiltHand plain = build_hand(spec, one);
  one.deviations = {{"hand_mass", 0.0}};
  EXPECT_EQ(build_hand(spec, one).mass, plain.mass) << "a deviation of zero changes no bit";
  one.deviations = {{"segments", 1.0},         {"passive_tissue", -1.0}, {"ranges", 1.0},
                    {"extrinsic_forces", 1.0}, {"intrinsic_arms", 2.0},  {"hand_breadth", 1.0}};
  one.hand_length = plain.size.length;
  const BuiltHand other = build_hand(spec, one);
  EXPECT_EQ(other.size.length, plain.size.length);
  const Eigen::Matrix4d c = spec.anthropometry.by_sex.residual_covariance;
  EXPECT_NEAR(std::log(other.size.breadth / plain.size.breadth),
              std::sqrt(c(1, 1) - c(0, 1) * c(0, 1) / c(0, 0)), 2e-3);
  EXPECT_NEAR(other.segments[3].length / plain.segments[3].length, std::exp(spec.spread.at("segments")),
              1e-12);
  for (std::size_t j = 0; j < plain.joints.size(); ++j)
    for (std::size_t a = 0; a < plain.joints[j].axes.size(); ++a) {
      const model::JointAxis &before = plain.joints[j].axes[a], &after = other.joints[j].axes[a];
      EXPECT_GE(after.stop->high, before.stop->high);
      EXPECT_LE(after.stop->low, before.stop->low);
      EXPECT_LE(after.stop->high - before.stop->high, spec.spread.at("ranges") + 1e-12);
      EXPECT_NEAR(after.tissue->stiffness / before.tissue->stiffness,
                  std::exp(-spec.spread.at("passive_tissue")), 1e-12);
    }
  const double arms = std::exp(2 * spec.muscles->spread.at("intrinsic_arms"));
  const double forces = std::exp(spec.muscles->spread.at("extrinsic_forces"));
  for (std::size_t m = 0; m < plain.muscles.muscles.size(); ++m) {
    const model::Muscle &before = plain.muscles.muscles[m], &after = other.muscles.muscles[m];
    EXPECT_NEAR(after.force / before.force, before.extrinsic ? forces : 1, 1e-12) << before.name;
    EXPECT_NEAR(after.path.arms[0].c[0], before.path.arms[0].c[0] * (before.extrinsic ? 1 : arms), 1e-12);
  }
  EXPECT_EQ(uncertain_of(spec, one, false),
            (std::vector<std::string>{"hand_length", "hand_breadth", "palm_length", "hand_circumference",
                                      "segments", "hand_mass", "ranges", "passive_tissue", "grip_strength"}));
}

// Oracle: the values of the person file, times what one standard deviation of measuring is: 1 %.
TEST(Deviations, MeasuredValuesReplacePredictionsAndHaveASmallSpreadOfTheirOwn) {
  const HandSpec spec = shipped("anatomical");
  Person one = person(1.75, 72, Sex::male);
  one.hand_length = 0.185;
  one.fingers = {{"thumb", 0.058}, {"middle", 0.08}};
  one.bones = {{"ring_proximal", 0.04}};
  one.radii = {{"ring_proximal", 0.008}};
  const BuiltHand stated = build_hand(spec, one);
  for (const double z : {0.0, 1.0, -2.0}) {
    one.deviations = {{"segments", z}, {"hand_breadth", 1.0}};
    const BuiltHand hand = build_hand(spec, one);
    const double factor = std::exp(0.01 * z);
    EXPECT_EQ(hand.size.length, 0.185);
    EXPECT_NEAR(hand.size.fingers.at("thumb").length, 0.058 * factor, 1e-12);
    EXPECT_NEAR(hand.size.fingers.at("middle").length, 0.08 * factor, 1e-12);
    for (std::size_t i = 0; i < spec.segments.size(); ++i) {
      const double ratio = hand.segments[i].length / stated.segments[i].length;
      const std::string& name = spec.segments[i].name;
      if (name == "thumb_distal" || name == "middle_proximal" || name == "ring_proximal") {
        EXPECT_NEAR(ratio, factor, 1e-12) << name;
      } else if (name == "ring_distal" || name == "thumb_metacarpal") {
        EXPECT_NEAR(ratio, std::exp(spec.spread.at("segments") * z), 1e-12) << name << ": is not measured";
      }
      if (name == "ring_proximal") {
        EXPECT_NEAR(hand.segments[i].radius, 0.008 * factor, 1e-12);
      }
    }
  }
  one.deviations = {{"hand_length", 1.0}};
  EXPECT_NEAR(build_hand(spec, one).size.length, 0.185 * std::exp(0.01), 1e-12);
}

TEST(Deviations, AreRefusedByName) {
  YamlNode node =
      parse_yaml("{stature: 1.75, mass: 72, sex: male, deviations: {hand_lenght: 1, segments: 9}}", "p.yaml");
  Diagnostics diagnostics;
  read_person(node, "", diagnostics);
  const std::string text = Error(diagnostics.problems).what();
  EXPECT_NE(text.find("nearest: hand_length"), std::string::npos) << text;
  EXPECT_NE(text.find("deviations.segments: got 9"), std::string::npos) << text;
}

// Oracle: a deviation beside the measured value is refused; one that the hand model gives no spread is told.
TEST(Deviations, ThatCannotActAreNamed) {
  YamlNode node = parse_yaml(
      "{stature: 1.75, mass: 72, sex: male, hand_mass: 400 g, deviations: {hand_mass: 1}}", "p.yaml");
  Diagnostics diagnostics;
  read_person(node, "", diagnostics);
  const std::string text = Error(diagnostics.problems).what();
  EXPECT_NE(text.find("a deviation of hand_mass beside"), std::string::npos) << text;
  Person one = person(1.75, 72, Sex::male);
  one.deviations = {{"segments", 1}, {"hand_length", 1}};
  EXPECT_TRUE(doubts(shipped("anatomical"), one).empty());
  const std::vector<std::string> told = doubts(shipped("prototype"), one);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].rfind("deviations.segments does nothing", 0), 0U) << told[0];
}

}  // namespace
}  // namespace handsim::hand
