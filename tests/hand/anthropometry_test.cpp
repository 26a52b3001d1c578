#include "handsim/hand/anthropometry.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "hand/shipped_hands.h"

namespace handsim::hand {
namespace {

Anthropometry shipped() {
  YamlNode node = load_yaml(HANDSIM_SOURCE_DIR "/handmodels/anthropometry.yaml");
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
    std::ifstream file(HANDSIM_SOURCE_DIR "/tests/data/oracles/ansur2_hands.csv");
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
  const Anthropometry anthropometry = shipped();
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
  const Anthropometry anthropometry = shipped();
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
  const Anthropometry anthropometry = shipped();
  EXPECT_EQ(anthropometry.stature_range, std::pair(low, high));
}

TEST(Anthropometry, MeasuredDimensionsOverrideThePrediction) {
  Person p = person(1.75, 72, Sex::male);
  p.hand_length = 0.201;
  p.hand_breadth = 0.09;
  const HandSize size = hand_size(shipped(), p);
  EXPECT_EQ(size.length, 0.201);
  EXPECT_EQ(size.breadth, 0.09);
  EXPECT_TRUE(size.measured[0]);
  EXPECT_FALSE(size.measured[3]);
}

// Oracle: for one known residual the conditional mean is covariance / variance times it.
TEST(Anthropometry, AMeasuredLengthShiftsTheOtherDimensionsByTheirCovariance) {
  const Anthropometry anthropometry = shipped();
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
  const Anthropometry anthropometry = shipped();
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
    EXPECT_THROW(hand_size(shipped(), p), Error) << circumference;
  }
}

// Oracle: the perimeter of a slab with half-round edges, 2 (b - t) + pi t.
TEST(Anthropometry, StadiumHasTheGivenCircumference) {
  const double t = stadium_thickness(0.212, 0.088);
  EXPECT_NEAR(2 * (0.088 - t) + M_PI * t, 0.212, 1e-15);
}

// A power law gives every person of the accepted range a hand.
TEST(Anthropometry, TheWholeAcceptedRangeHasHands) {
  const Anthropometry anthropometry = shipped();
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

// Oracle: tabulated quantiles of the standard normal distribution.
TEST(NormalQuantile, MatchesTheTable) {
  EXPECT_NEAR(normal_quantile(0.5), 0, 1e-12);
  EXPECT_NEAR(normal_quantile(0.975), 1.959963984540054, 1e-12);
  EXPECT_NEAR(normal_quantile(0.05), -1.6448536269514729, 1e-12);
}

}  // namespace
}  // namespace handsim::hand
