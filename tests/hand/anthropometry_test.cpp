#include "handsim/hand/anthropometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>
#include <sstream>

#include "hand/shipped_hands.h"
#include "handsim/hand/build.h"
#include "places.h"
#include "support/sanitized.h"

namespace handsim::hand {
namespace {

Anthropometry shipped_anthropometry() {
  YamlNode node = load_yaml(test::in_source("handmodels/anthropometry.yaml"));
  Diagnostics diagnostics;
  Anthropometry out = read_anthropometry(node, "", diagnostics);
  diagnostics.throw_if_any();
  return out;
}

/// Rows of the survey from which the shipped coefficients were fitted.
struct Survey {
  std::vector<Person> people;
  std::vector<Eigen::Vector4d> hands;  ///< length, breadth, palm length, circumference [m]

  Survey() {
    std::ifstream file(test::in_source("tests/data/oracles/ansur2_hands.csv"));
    std::string line;
    while (std::getline(file, line)) {
      if (line.empty() || line[0] == '#' || line.starts_with("sex")) continue;
      std::istringstream fields(line);
      std::string sex;
      std::getline(fields, sex, ',');
      double v[6];
      char comma;
      for (double& value : v) fields >> value >> comma;
      // Millimetres and tenths of a kilogram: the quotients equal the decimal SI numbers exactly.
      people.push_back(person(v[0] / 1000, v[1] / 10, sex == "F" ? Sex::female : Sex::male));
      hands.emplace_back(v[2] / 1000, v[3] / 1000, v[4] / 1000, v[5] / 1000);
    }
  }
};

double predicted(const HandSize& size, int k) {
  const double all[] = {size.length, size.breadth, size.palm_length, size.circumference};
  return all[k];
}

class AnthropometrySurvey : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_EQ(survey.people.size(), 4247U); }
  Survey survey;
};

// Oracle: the survey's rows. Bounds: what a good linear fit reaches (7.35 and 3.44 mm).
TEST_F(AnthropometrySurvey, PredictsLengthWithin7_4AndBreadthWithin3_5MillimetresWithoutBias) {
  const Anthropometry anthropometry = shipped_anthropometry();
  const double rmse_bound[] = {7.4e-3, 3.5e-3};
  for (int k = 0; k < 2; ++k) {
    double squares = 0, sum[2] = {0, 0};
    int count[2] = {0, 0};
    for (std::size_t i = 0; i < survey.people.size(); ++i) {
      const double error = predicted(hand_size(anthropometry, survey.people[i]), k) - survey.hands[i][k];
      const int sex = survey.people[i].sex == Sex::female ? 1 : 0;
      squares += error * error;
      sum[sex] += error;
      ++count[sex];
    }
    EXPECT_LE(std::sqrt(squares / static_cast<double>(survey.people.size())), rmse_bound[k]);
    for (int sex = 0; sex < 2; ++sex) EXPECT_LE(std::abs(sum[sex] / count[sex]), 0.2e-3) << "sex " << sex;
  }
}

// Oracle: the least-squares fit, computed again from the rows by QR.
TEST_F(AnthropometrySurvey, CoefficientsAreTheLeastSquaresFitOfTheRows) {
  const Anthropometry anthropometry = shipped_anthropometry();
  const auto n = static_cast<Eigen::Index>(survey.people.size());
  for (const bool by_sex : {true, false}) {
    const Fit& fit = by_sex ? anthropometry.by_sex : anthropometry.pooled;
    Eigen::MatrixXd x(n, by_sex ? 4 : 3);
    Eigen::MatrixXd y(n, 4);
    for (Eigen::Index i = 0; i < n; ++i) {
      const Person& p = survey.people[static_cast<std::size_t>(i)];
      x(i, 0) = 1;
      x(i, 1) = std::log(p.stature);
      x(i, 2) = std::log(p.mass);
      if (by_sex) x(i, 3) = p.sex == Sex::female ? 1 : 0;
      y.row(i) = survey.hands[static_cast<std::size_t>(i)].array().log().transpose();
    }
    const Eigen::MatrixXd b = x.colPivHouseholderQr().solve(y);
    const Eigen::MatrixXd residual = y - x * b;
    const Eigen::MatrixXd covariance = residual.transpose() * residual / static_cast<double>(n - x.cols());
    EXPECT_LT((covariance - fit.residual_covariance).norm(), 1e-12);
    for (int k = 0; k < 4; ++k) {
      const Allometry& a = fit.dimensions[static_cast<std::size_t>(k)];
      EXPECT_NEAR(a.intercept, b(0, k), 1e-9);
      EXPECT_NEAR(a.stature, b(1, k), 1e-9);
      EXPECT_NEAR(a.mass, b(2, k), 1e-9);
      EXPECT_NEAR(a.female, by_sex ? b(3, k) : 0.0, 1e-9);
      EXPECT_NEAR(a.smearing, residual.col(k).array().exp().mean(), 1e-9);
    }
  }
}

TEST_F(AnthropometrySurvey, RangeIsTheRows) {
  double low = 9, high = 0;
  for (const Person& p : survey.people) {
    low = std::min(low, p.stature);
    high = std::max(high, p.stature);
  }
  const Anthropometry anthropometry = shipped_anthropometry();
  EXPECT_EQ(anthropometry.survey.stature, std::pair(low, high));
}

TEST(Anthropometry, MeasuredDimensionsOverrideThePrediction) {
  Person p = person(1.75, 72, Sex::male);
  p.hand_length = 0.201;
  p.hand_breadth = 0.09;
  const HandSize size = hand_size(shipped_anthropometry(), p);
  EXPECT_EQ(size.length, 0.201);
  EXPECT_EQ(size.breadth, 0.09);
  EXPECT_TRUE(size.measured[0]);
  EXPECT_FALSE(size.measured[3]);
}

// Oracle: for one known residual the conditional mean is covariance / variance times it.
TEST(Anthropometry, AMeasuredLengthShiftsTheOtherDimensionsByTheirCovariance) {
  const Anthropometry anthropometry = shipped_anthropometry();
  Person p = person(1.75, 72, Sex::male);
  const HandSize plain = hand_size(anthropometry, p);
  const double shift = 0.05;
  p.hand_length = plain.length / anthropometry.by_sex.dimensions[0].smearing * std::exp(shift);
  const HandSize moved = hand_size(anthropometry, p);
  const Eigen::Matrix4d& c = anthropometry.by_sex.residual_covariance;
  EXPECT_NEAR(std::log(moved.breadth / plain.breadth), c(1, 0) / c(0, 0) * shift, 1e-12);
  EXPECT_NEAR(std::log(moved.circumference / plain.circumference), c(3, 0) / c(0, 0) * shift, 1e-12);
}

TEST(Anthropometry, PercentilesSpreadByTheResidualDeviation) {
  const Anthropometry anthropometry = shipped_anthropometry();
  Person p = person(1.63, 60, Sex::female);
  const double plain = hand_size(anthropometry, p).length;
  p.hand_length_percentile = 50;
  EXPECT_NEAR(hand_size(anthropometry, p).length, plain, 1e-12);
  p.hand_length_percentile = 97.7249868;  // two standard deviations
  EXPECT_NEAR(std::log(hand_size(anthropometry, p).length / plain),
              2 * std::sqrt(anthropometry.by_sex.residual_covariance(0, 0)), 1e-8);
}

TEST(Anthropometry, CircumferencesThatFitNoHandAreRefused) {
  Person p = person(1.75, 72, Sex::male);
  p.hand_breadth = 0.09;
  for (const double circumference : {0.17, 0.30}) {
    p.hand_circumference = circumference;
    EXPECT_THROW(hand_size(shipped_anthropometry(), p), Error) << circumference;
  }
}

// Oracle: the perimeter of a slab with half-round edges, 2 (b - t) + pi t.
TEST(Anthropometry, StadiumHasTheGivenCircumference) {
  const double t = stadium_thickness(0.212, 0.088);
  EXPECT_NEAR(2 * (0.088 - t) + M_PI * t, 0.212, 1e-15);
}

// A power law gives every person of the accepted range a hand.
TEST(Anthropometry, TheWholeAcceptedRangeHasHands) {
  const Anthropometry anthropometry = shipped_anthropometry();
  for (const Sex sex : {Sex::male, Sex::female, Sex::unknown})
    for (double stature = 0.5; stature <= 2.5; stature += 0.1)
      for (const double bmi : {12.0, 22.0, 40.0}) {
        const double mass = std::max(2.0, bmi * stature * stature);
        const HandSize size = hand_size(anthropometry, person(stature, mass, sex));
        EXPECT_GT(size.length / stature, 0.09);
        EXPECT_LT(size.length / stature, 0.14);
        EXPECT_GT(size.thickness, 0.005);
      }
}

/// Stored children of the survey, see the file.
struct ChildRow {
  Person person;
  double measured[5];  ///< length, breadth, thumb, index, middle [m]; 0: not measured
};

std::vector<ChildRow> stored_children(bool with_age, bool with_sex) {
  std::ifstream file(test::in_source("tests/data/oracles/children_hands.csv"));
  std::vector<ChildRow> out;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#' || line.starts_with("sex")) continue;
    std::istringstream fields(line.substr(2));
    double v[8];
    char comma;
    for (double& value : v) fields >> value >> comma;
    const Sex sex = line[0] == 'f' ? Sex::female : Sex::male;
    ChildRow& row =
        out.emplace_back(ChildRow{person(v[1] / 1000, v[2] / 10, with_sex ? sex : Sex::unknown),
                                  {v[3] / 1000, v[4] / 1000, v[5] / 1000, v[6] / 1000, v[7] / 1000}});
    if (with_age) row.person.age = v[0] / 12;
  }
  return out;
}

/// RMSE and bias [mm] of one dimension, of children from one age [years] to below another.
std::pair<double, double> errors(const Anthropometry& anthropometry, bool with_age, bool with_sex, int k,
                                 double low, double high) {
  const std::vector<ChildRow> ages = stored_children(true, true), rows = stored_children(with_age, with_sex);
  double sum = 0, squares = 0, count = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (*ages[i].person.age < low || *ages[i].person.age >= high || rows[i].measured[k] == 0) continue;
    const HandSize size = hand_size(anthropometry, rows[i].person);
    const double own = k < 2 ? predicted(size, k) : size.fingers.at(kMeasuredFingers[k - 2]).length;
    const double error = 1e3 * (own - rows[i].measured[k]);
    sum += error;
    squares += error * error;
    ++count;
  }
  return {std::sqrt(squares / count), sum / count};
}

// Oracle: rows of the survey. Bounds of bias: 1 mm, and three standard errors of bands of 90 to 170 children
// (6 mm / sqrt(100) = 0.6). Breadth without the sex: boys' and girls' differ by 7 mm at 17 years.
TEST(Children, OfTheSurveyHaveTheirHandsAtEveryAge) {
  const Anthropometry anthropometry = shipped_anthropometry();
  for (const bool with_sex : {true, false}) {
    EXPECT_LE(errors(anthropometry, true, with_sex, 0, 2, 20).first, 6.6);
    EXPECT_LE(errors(anthropometry, true, with_sex, 1, 2, 20).first, with_sex ? 3.4 : 4.1);
    for (double low = 2; low < 18; low += 4)
      for (const int k : {0, 1})
        EXPECT_LE(std::abs(errors(anthropometry, true, with_sex, k, low, low + 4).second), 1.8)
            << "dimension " << k << " at " << low << " years, sex " << with_sex;
  }
}

// Without an age a body of an adult's size has an adult's hand: young women's are 5 mm shorter.
TEST(Children, OfUnknownAgeHaveTheirHandsUpToAnAdultsSize) {
  const Anthropometry anthropometry = shipped_anthropometry();
  EXPECT_LE(errors(anthropometry, false, true, 0, 2, 20).first, 6.6);
  EXPECT_LE(errors(anthropometry, false, true, 1, 2, 20).first, 3.4);
  for (double low = 2; low < 14; low += 4)
    for (const int k : {0, 1})
      EXPECT_LE(std::abs(errors(anthropometry, false, true, k, low, low + 4).second), 1.8)
          << k << ", " << low;
}

// Oracle: residuals of a free quadratic regression on the whole survey: 3.84, 3.63 and 3.84 mm; a tenth more.
TEST(Children, HaveTheFingersOfTheSurvey) {
  const double floors[] = {3.84, 3.63, 3.84};
  for (int finger = 0; finger < 3; ++finger)
    EXPECT_LE(errors(shipped_anthropometry(), true, true, 2 + finger, 2, 20).first, 1.1 * floors[finger])
        << finger;
}

// Oracle: two neighbours on a grid. A step of 1 mm, 20 g or 4 days changes no dimension by more than 0.3 %;
// a jump between two fits is 3 % of an 18-year-old's hand.
TEST(Children, GrowWithoutAJumpIntoAdults) {
  const Anthropometry anthropometry = shipped_anthropometry();
  const auto close = [&](const Person& a, const Person& b) {
    const HandSize one = hand_size(anthropometry, a), other = hand_size(anthropometry, b);
    for (int k = 0; k < 4; ++k)
      EXPECT_LT(std::abs(std::log(predicted(other, k) / predicted(one, k))), 3e-3)
          << a.stature << " m, " << a.mass << " kg, " << a.age.value_or(-1) << " years, dimension " << k;
    for (const auto& [name, finger] : one.fingers)
      EXPECT_LT(std::abs(std::log(other.fingers.at(name).length / finger.length)), 3e-3) << name;
  };
  for (const Sex sex : {Sex::male, Sex::female, Sex::unknown})
    for (double stature = 0.6; stature < 2.05; stature += 0.05)
      for (const double index : {13.0, 16.0, 20.0, 26.0})
        for (const double age : {0.0, 1.0, 3.0, 9.0, 15.0, 18.3, 19.0, 19.9, 30.0}) {
          Person one = person(stature, index * stature * stature, sex);
          if (age > 0) one.age = age;
          Person taller = one, heavier = one, older = one;
          taller.stature += 0.001;
          close(one, taller);
          heavier.mass += 0.02;
          close(one, heavier);
          if (!one.age) continue;
          *older.age += 4.0 / 365;
          close(one, older);
        }
}

TEST(Children, OfUnknownSexAreBetweenBoysAndGirls) {
  const Anthropometry anthropometry = shipped_anthropometry();
  for (double age = 2; age <= 18; age += 0.5)
    for (double stature = 0.8; stature < 1.9; stature += 0.1) {
      Person boy = person(stature, 17 * stature * stature, Sex::male);
      boy.age = age;
      Person girl = boy, either = boy;
      girl.sex = Sex::female;
      either.sex = Sex::unknown;
      const HandSize a = hand_size(anthropometry, boy), b = hand_size(anthropometry, girl),
                     c = hand_size(anthropometry, either);
      for (int k = 0; k < 2; ++k) {
        EXPECT_GE(predicted(c, k), std::min(predicted(a, k), predicted(b, k)) * (1 - 1e-3));
        EXPECT_LE(predicted(c, k), std::max(predicted(a, k), predicted(b, k)) * (1 + 1e-3));
      }
    }
}

// Oracle: the adults' fits, computed here.
TEST(Adults, AreNotChangedByTheChildren) {
  const Anthropometry anthropometry = shipped_anthropometry();
  Anthropometry soldiers = anthropometry;
  soldiers.children.reset();
  for (const auto& [stature, mass] :
       {std::pair(1.525, 51.4), {1.627, 66.9}, {1.7, 57.0}, {1.755, 84.5}, {2.1, 140.0}})
    for (const Sex sex : {Sex::male, Sex::female, Sex::unknown})
      for (const std::optional<double> age : {std::optional<double>(), {20.0}, {80.0}}) {
        Person p = person(stature, mass, sex);
        p.age = age;
        for (int k = 0; k < 4; ++k)
          EXPECT_EQ(predicted(hand_size(anthropometry, p), k), predicted(hand_size(soldiers, p), k));
      }
}

TEST(Children, AreToldHowFarTheyAreOutsideTheSurvey) {
  const Anthropometry anthropometry = shipped_anthropometry();
  Person p = person(2.1, 80, Sex::male);
  ASSERT_EQ(extrapolations(anthropometry, p).size(), 1U);
  EXPECT_EQ(extrapolations(anthropometry, p)[0],
            "stature of 2.1 m is outside the survey (1.409 to 1.993 m) by 0.107 m: extrapolated");
  p = person(0.75, 9, Sex::female);
  p.age = 1;
  EXPECT_EQ(extrapolations(anthropometry, p).size(), 3U);
  // Oracle: the survey's median girl of 4 years is 1.02 m tall, with 4.35 %.
  p = person(1.25, 22, Sex::female);
  p.age = 4;
  ASSERT_EQ(extrapolations(anthropometry, p).size(), 1U);
  EXPECT_TRUE(extrapolations(anthropometry, p)[0].starts_with(
      "stature of 1.25 m is 4.7 standard deviations from that of children of 4 years"));
  p.age = 9;
  EXPECT_TRUE(extrapolations(anthropometry, p).empty());
}

TEST(Fingers, ThatAreMeasuredReplaceTheirPrediction) {
  const HandSpec spec = hand::shipped("anatomical");
  Person p = person(1.4, 32, Sex::female);
  p.age = 10;
  const BuiltHand plain = build_hand(spec, p);
  p.fingers["thumb"] = 0.058;
  p.radii["index_middle"] = 0.0065;
  const BuiltHand own = build_hand(spec, p);
  EXPECT_EQ(own.size.fingers.at("thumb").length, 0.058);
  const double scale = 0.058 / plain.size.fingers.at("thumb").length;
  for (std::size_t i = 0; i < spec.segments.size(); ++i) {
    const bool of_thumb = spec.segments[i].finger == "thumb" && spec.segments[i].parent;
    EXPECT_NEAR(own.segments[i].length, (of_thumb ? scale : 1) * plain.segments[i].length, 1e-15);
    EXPECT_EQ(own.segments[i].radius,
              spec.segments[i].name == "index_middle" ? 0.0065 : plain.segments[i].radius);
  }
  p.fingers["ring"] = 0.058;
  EXPECT_THROW(build_hand(spec, p), Error);
}

// Oracle: tabulated quantiles of the standard normal distribution.
/// Share of people whose length, or breadth, is within the middle 90 % of 200 drawn hands of their body.
double coverage(const Anthropometry& anthropometry, const std::vector<Person>& people,
                const std::vector<double>& measured, int k) {
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  std::vector<std::map<std::string, double>> deviations(200);
  for (auto& each : deviations)
    for (int i = 0; i < kHandDimensions; ++i)
      each[std::string(kDeviations[static_cast<std::size_t>(i)])] = normal(generator);
  double inside = 0;
  for (std::size_t i = 0; i < people.size(); ++i) {
    std::vector<double> drawn;
    Person one = people[i];
    for (const auto& each : deviations) {
      one.deviations = each;
      drawn.push_back(predicted(hand_size(anthropometry, one), k));
    }
    std::ranges::sort(drawn);
    inside += drawn[10] <= measured[i] && measured[i] <= drawn[189] ? 1 : 0;
  }
  return inside / static_cast<double>(people.size());
}

// Oracle: measured hands of the surveys, of which 90 % have to be within the middle 90 %; 2 % for adults
// (standard error 0.8 % of 1400), 4 % for the stored fifth of the children (1.3 %).
TEST_F(AnthropometrySurvey, DrawnHandsCoverMeasuredOnes) {
  HANDSIM_SKIP_WITH_SANITIZER("other tests draw hands, too");
  const Anthropometry anthropometry = shipped_anthropometry();
  for (const int k : {0, 1}) {
    std::vector<Person> people;
    std::vector<double> measured;
    for (std::size_t i = 0; i < survey.people.size(); i += 3) {
      people.push_back(survey.people[i]);
      measured.push_back(survey.hands[i][k]);
    }
    EXPECT_NEAR(coverage(anthropometry, people, measured, k), 0.9, 0.02) << k;
    people.clear();
    measured.clear();
    for (const ChildRow& row : stored_children(true, true)) {
      if (row.measured[k] == 0) continue;
      people.push_back(row.person);
      measured.push_back(row.measured[k]);
    }
    EXPECT_NEAR(coverage(anthropometry, people, measured, k), 0.9, 0.04) << "children, " << k;
  }
}

TEST(NormalQuantile, MatchesTheTable) {
  EXPECT_NEAR(normal_quantile(0.5), 0, 1e-12);
  EXPECT_NEAR(normal_quantile(0.975), 1.959963984540054, 1e-12);
  EXPECT_NEAR(normal_quantile(0.05), -1.6448536269514729, 1e-12);
}

}  // namespace
}  // namespace handsim::hand
