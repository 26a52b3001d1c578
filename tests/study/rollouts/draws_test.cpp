// What rollouts draw.
#include "handsim/environment/draws.h"

#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "handsim/study/rollouts/population.h"
#include "handsim/study/rollouts/rollout_study.h"
#include "scene_files.h"

namespace handsim::study {
namespace {

using environment::Draws;
using environment::philox;
using environment::RandomWords;

// Oracle: the known answers that Random123 ships for philox4x64 of ten rounds (kat_vectors).
TEST(Draws, PhiloxGivesRandom123sKnownAnswers) {
  const std::uint64_t ones = ~std::uint64_t{0};
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (RandomWords{0x16554d9eca36314cU, 0xdb20fe9d672d0fdcU,
                                                       0xd7e772cee186176bU, 0x7e68b68aec7ba23bU}));
  EXPECT_EQ(
      philox({ones, ones, ones, ones}, {ones, ones}),
      (RandomWords{0x87b092c3013fe90bU, 0x438c3c67be8d0224U, 0x9cc7d7c69cd777b6U, 0xa09caebf594f0ba0U}));
  EXPECT_EQ(
      philox({0x243f6a8885a308d3U, 0x13198a2e03707344U, 0xa4093822299f31d0U, 0x082efa98ec4e6c89U},
             {0x452821e638d01377U, 0xbe5466cf34e90c6cU}),
      (RandomWords{0xa528f45403e61d95U, 0x38c72dbd566e9788U, 0xa5a1610e72fd18b5U, 0x57bd43b5e52b7fe6U}));
}

// Oracle: independence of what else is drawn; the counter says which number it is.
TEST(Draws, AreAFunctionOfSeedDrawAndName) {
  Draws a(1, 7, "mass"), b(1, 7, "mass");
  Draws(1, 7, "friction").uniform();
  std::set<double> all;
  for (int i = 0; i < 10; ++i) {
    const double x = a.uniform();
    EXPECT_EQ(x, b.uniform());
    all.insert(x);
  }
  EXPECT_EQ(all.size(), 10U);
  for (Draws other : {Draws(2, 7, "mass"), Draws(1, 8, "mass"), Draws(1, 7, "friction")})
    EXPECT_FALSE(all.contains(other.uniform()));
}

// Oracle: moments of the uniform and the normal distribution, within five standard errors.
TEST(Draws, HaveTheMomentsOfTheirDistributions) {
  constexpr int kCount = 20000;
  double sum = 0, squares = 0, normal = 0, normal_squares = 0, fourth = 0;
  for (int i = 0; i < kCount; ++i) {
    Draws draws(3, static_cast<std::uint64_t>(i), "x");
    const double u = draws.uniform(), z = draws.normal();
    ASSERT_GT(u, 0);
    ASSERT_LT(u, 1);
    sum += u, squares += u * u, normal += z, normal_squares += z * z, fourth += z * z * z * z;
  }
  const double n = kCount, root = std::sqrt(n);
  EXPECT_NEAR(sum / n, 0.5, 5 * std::sqrt(1 / 12.0) / root);
  EXPECT_NEAR(squares / n, 1 / 3.0, 5 * std::sqrt(4 / 45.0) / root);
  EXPECT_NEAR(normal / n, 0, 5 / root);
  EXPECT_NEAR(normal_squares / n, 1, 5 * std::sqrt(2.0) / root);
  EXPECT_NEAR(fourth / n, 3, 5 * std::sqrt(96.0) / root);
}

// Oracle: means, deviations and correlations of the survey's data (4247 persons; computed outside handsim),
// within five standard errors: men 1.7561 m, 0.0690 m, 85.4 kg, 14.1 kg, 0.478 between stature and mass;
// women 1.6287 m, 0.0641 m, 67.8 kg, 10.9 kg, 0.544.
TEST(Population, HasTheSurveysMeansDeviationsAndCorrelation) {
  struct Sex {
    hand::Sex sex;
    double stature, stature_deviation, mass, mass_deviation, correlation;
  };
  for (const Sex& of : {Sex{hand::Sex::male, 1.7561, 0.0690, 85.38, 14.14, 0.478},
                        Sex{hand::Sex::female, 1.6287, 0.0641, 67.83, 10.91, 0.544}}) {
    constexpr int kCount = 20000;
    double s = 0, m = 0, ss = 0, mm = 0, sm = 0;
    for (int i = 0; i < kCount; ++i) {
      Draws draws(1, static_cast<std::uint64_t>(i), "person");
      const hand::Person person = draw_person(*population("ansur2"), of.sex, draws);
      EXPECT_EQ(person.sex, of.sex);
      const double a = person.stature - of.stature, b = person.mass - of.mass;
      s += a, m += b, ss += a * a, mm += b * b, sm += a * b;
    }
    const double n = kCount, root = std::sqrt(n), deviation = std::sqrt(ss / n),
                 kilograms = std::sqrt(mm / n);
    EXPECT_NEAR(s / n, 0, 5 * of.stature_deviation / root);
    EXPECT_NEAR(m / n, 0, 5 * of.mass_deviation / root + 0.1);
    EXPECT_NEAR(deviation, of.stature_deviation, 5 * of.stature_deviation / root);
    EXPECT_NEAR(kilograms, of.mass_deviation, 0.03 * of.mass_deviation);
    EXPECT_NEAR(sm / n / deviation / kilograms, of.correlation, 5 / root);
  }
}

// Oracle: equal chances of the two sexes.
TEST(Population, DrawsEitherSexWithEqualChances) {
  int women = 0;
  constexpr int kCount = 10000;
  for (int i = 0; i < kCount; ++i) {
    Draws draws(1, static_cast<std::uint64_t>(i), "person");
    women += draw_person(*population("ansur2"), std::nullopt, draws).sex == hand::Sex::female;
  }
  EXPECT_NEAR(women, kCount / 2, 5 * 0.5 * std::sqrt(kCount));
}

// Oracle: a mass below 0, which no scene can have, between others, which it can.
TEST(Draws, AreRefusedForTheLeastOfManyLevelsWhereverItStands) {
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "study.yaml";
  const auto refusal = [&](std::string masses) -> std::string {
    for (int i = 0; i < 30; ++i) masses = "20 g, " + masses + ", 21 g";
    std::ofstream(file) << "scene: " << test::source("config/grasp_pinch.yaml").string()
                        << "\nvary: {objects.0.mass: {each: [" << masses << "]}}\n";
    try {
      const RolloutStudy study(load_rollouts(file));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal("19 g"), "");
  EXPECT_NE(refusal("-1 g").find("objects.0.mass: got -1 g"), std::string::npos);
}

}  // namespace
}  // namespace handsim::study
