#include "handsim/hand/grip_strength.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "scene_files.h"

namespace handsim::hand {
namespace {

GripTable shipped_table() {
  YamlNode root = load_yaml(test::source("handmodels/grip_strength.yaml"));
  Diagnostics diagnostics;
  GripTable table = read_grip_table(root, "", diagnostics);
  diagnostics.throw_if_any();
  return table;
}

Person surveyed(Sex sex, double stature, std::optional<double> age = {}) {
  Person out;
  out.sex = sex;
  out.stature = stature;
  out.age = age;
  return out;
}

// Oracle: Steiber 2016, as quoted: a man of 30 to 34 years and 175 to 179 cm grips with 53.5 (8.3) kgf, a
// woman of 160 to 164 cm with 32.7 (5.8) kgf.
TEST(GripStrength, IsTheSurveysMeanForSexAgeAndStature) {
  const GripTable table = shipped_table();
  constexpr double kKilogramForce = 9.80665;
  const GripStrength man = grip_strength(table, surveyed(Sex::male, 1.77, 34.9));
  EXPECT_NEAR(man.norm, 53.5 * kKilogramForce, 0.1);
  EXPECT_NEAR(man.deviation, 8.3 * kKilogramForce, 0.1);
  EXPECT_FALSE(man.extrapolated);
  const GripStrength woman = grip_strength(table, surveyed(Sex::female, 1.62, 30));
  EXPECT_NEAR(woman.norm, 32.7 * kKilogramForce, 0.1);
  EXPECT_EQ(woman.own, woman.norm);
  const GripStrength unknown = grip_strength(table, surveyed(Sex::unknown, 1.77));
  const GripStrength tall_woman = grip_strength(table, surveyed(Sex::female, 1.77));
  EXPECT_NEAR(unknown.norm, (man.norm + tall_woman.norm) / 2, 1e-9);
}

TEST(GripStrength, AssignsABoundaryToTheTallerGroupAndReportsExtrapolation) {
  const GripTable table = shipped_table();
  EXPECT_EQ(grip_strength(table, surveyed(Sex::male, 1.75)).norm,
            grip_strength(table, surveyed(Sex::male, 1.79)).norm);
  EXPECT_NE(grip_strength(table, surveyed(Sex::male, 1.7499)).norm,
            grip_strength(table, surveyed(Sex::male, 1.75)).norm);
  const GripStrength old = grip_strength(table, surveyed(Sex::male, 1.62, 95));
  EXPECT_TRUE(old.extrapolated);
  EXPECT_EQ(old.norm, grip_strength(table, surveyed(Sex::male, 1.62, 85)).norm);
  // A child has a row of its age; who states none is an adult, with muscles of smaller areas.
  EXPECT_FALSE(grip_strength(table, surveyed(Sex::male, 1.4, 8)).extrapolated);
  const GripStrength small = grip_strength(table, surveyed(Sex::male, 1.2)),
                     least = grip_strength(table, surveyed(Sex::male, 1.6));
  EXPECT_TRUE(small.extrapolated);
  EXPECT_NEAR(small.norm, 0.75 * 0.75 * least.norm, 1e-9);
  EXPECT_NEAR(small.deviation, 0.75 * 0.75 * least.deviation, 1e-9);
}

// Oracle: Dodds et al. 2014, as quoted: medians of 8, 17 and 29 kg of boys of 5, 10 and 15 years; Steiber
// 2016: women of 80 years have 0.6 times the grip of those of 30 years.
TEST(GripStrength, GrowsWithChildrenAndFallsWithElders) {
  const GripTable table = shipped_table();
  for (const auto& [age, stature, kilograms] :
       {std::tuple(5.0, 1.1, 8.0), {10.0, 1.4, 17.0}, {15.0, 1.7, 29.0}})
    EXPECT_NEAR(grip_strength(table, surveyed(Sex::male, stature, age)).norm, 9.80665 * kilograms, 0.1);
  double before = 0;
  for (double age = 2; age < 20; age += 1) {
    const GripStrength girl = grip_strength(table, surveyed(Sex::female, 1.65, age));
    EXPECT_GE(girl.norm, before) << age;
    EXPECT_FALSE(girl.extrapolated) << age;
    before = girl.norm;
  }
  // Nobody grows stronger by a birthday: a boy who grows 65 mm a year gains less than half of his grip in
  // one, chosen after a fifth had failed: norms of 3 and 5 years differ by 41 % a year themselves.
  const auto boy = [&](double age) {
    return grip_strength(table, surveyed(Sex::male, std::min(1.74, 0.77 + 0.065 * age), age));
  };
  for (double age = 2; age < 18.5; age += 0.01) {
    EXPECT_LT(boy(age + 0.01).norm / boy(age).norm, 1 + 0.01 * 0.5) << age;
    EXPECT_GE(boy(age + 0.01).norm, boy(age).norm) << age;
    EXPECT_LT(std::abs(boy(age + 0.01).deviation / boy(age).deviation - 1), 0.01) << age;
  }
  EXPECT_NEAR(grip_strength(table, surveyed(Sex::female, 1.3, 6.25)).norm, (78.5 + 117.7) / 2, 1e-9);
  const double old = grip_strength(table, surveyed(Sex::female, 1.62, 80)).norm;
  EXPECT_NEAR(old / grip_strength(table, surveyed(Sex::female, 1.62, 30)).norm, 0.6, 0.06);
}

TEST(GripStrength, OfAPersonWhoStatesItIsTheirOwn) {
  Person climber = surveyed(Sex::female, 1.62);
  climber.grip_strength = 410;
  const GripStrength strength = grip_strength(shipped_table(), climber);
  EXPECT_EQ(strength.own, 410);
  EXPECT_TRUE(strength.measured);
  EXPECT_NEAR(strength.norm, 320.7, 0.1);
}

}  // namespace
}  // namespace handsim::hand
