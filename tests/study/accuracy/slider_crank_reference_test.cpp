// The slider-crank's reference solution against published and independently computed series.
#include "support/slider_crank_reference.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "handsim/core/error.h"
#include "places.h"

namespace handsim::study {
namespace {

const std::filesystem::path kSeries = std::filesystem::path(test::in_source("tests/data/oracles"));

/// Rows of numbers below a line of headings.
std::vector<std::vector<double>> read_csv(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<std::vector<double>> rows;
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::istringstream cells(line);
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(std::stod(cell));
  }
  EXPECT_GT(rows.size(), 40U) << path;
  return rows;
}

/// Largest difference in any column; crank speeds are relative to the largest one.
double worst_difference(const SliderCrankSpec& spec, const std::vector<std::vector<double>>& rows) {
  std::vector<double> times;
  for (const std::vector<double>& row : rows) times.push_back(row[0]);
  const std::vector<SliderCrankState> found = SliderCrankReference(spec).at(times);
  double worst = 0, speed = 1;
  for (const SliderCrankState& state : found) speed = std::max(speed, std::abs(state.omega));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double all[] = {found[i].x, found[i].vx, found[i].theta, found[i].omega / speed};
    const double scale[] = {1, 1, 1, speed};
    for (std::size_t k = 0; k < std::min<std::size_t>(4, rows[i].size() - 1); ++k)
      worst = std::max(worst, std::abs(all[k] - rows[i][k + 1] / scale[k]));
  }
  return worst;
}

// Oracle: an independent solution (second-order jets, long double, RK4 at 2.5 us) with errors below 1e-12.
TEST(SliderCrankReference, ReachesTheKnownEndStateOfTheBenchmark) {
  const double times[] = {5};
  const SliderCrankState end = SliderCrankReference(SliderCrankSpec::iftomm()).at(times).front();
  EXPECT_NEAR(end.theta, 54.333332168313, 1e-9);
  EXPECT_NEAR(end.omega, 11.494996265042, 1e-9);
  EXPECT_NEAR(end.x, 0.240719573729614, 1e-9);
  EXPECT_NEAR(end.vx, -0.595984412044934, 1e-9);
}

// Oracle: as above.
TEST(SliderCrankReference, ReachesTheKnownEndStateUnderTorque) {
  const double times[] = {2};
  const SliderCrankState end = SliderCrankReference(SliderCrankSpec::constant_torque()).at(times).front();
  EXPECT_NEAR(end.theta, 57.856183816820, 1e-9);
  EXPECT_NEAR(end.omega, 45.439318546204, 1e-9);
  EXPECT_NEAR(end.x, 0.263916424967576, 1e-9);
  EXPECT_NEAR(end.vx, 1.954370283783685, 1e-9);
}

// Oracle: the same independent solution, every 50 ms.
TEST(SliderCrankReference, AgreesWithTheIndependentSeriesToOneInABillion) {
  EXPECT_LT(worst_difference(SliderCrankSpec::iftomm(), read_csv(kSeries / "slider_crank_iftomm.csv")), 1e-9);
  EXPECT_LT(
      worst_difference(SliderCrankSpec::constant_torque(), read_csv(kSeries / "slider_crank_torque.csv")),
      1e-9);
}

// Oracle: published (IFToMM library, Gonzalez); it differs from the exact series by 7.6e-5 m, rounded.
TEST(SliderCrankReference, AgreesWithThePublishedSliderPosition) {
  EXPECT_LT(worst_difference(SliderCrankSpec::iftomm(), read_csv(kSeries / "slider_crank_gonzalez.csv")),
            7.7e-5);
}

// Oracle: the reference itself; the accuracy study compares with these rows.
TEST(SliderCrankReference, MakesTheRowsThatTheAccuracyStudyHas) {
  const std::filesystem::path folder = std::filesystem::path(test::in_source("src/handsim/study/accuracy"));
  for (const auto& [name, spec, end] :
       {std::tuple("slider_crank_iftomm.csv", SliderCrankSpec::iftomm(), 5.0),
        {"slider_crank_torque.csv", SliderCrankSpec::constant_torque(), 2.0}}) {
    const auto rows = read_csv(folder / name);
    const std::vector<SliderCrankState> states = SliderCrankReference(spec).series(end, 0.01);
    ASSERT_EQ(rows.size(), states.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      EXPECT_NEAR(rows[i][0], states[i].x, 1e-12);
      EXPECT_NEAR(rows[i][1], states[i].vx, 1e-12);
    }
  }
}

/// Largest change of energy over the largest kinetic energy.
double energy_error(const SliderCrankSpec& spec, double duration) {
  const SliderCrankReference reference(spec);
  const std::vector<SliderCrankState> run = reference.series(duration, 0.01);
  double worst = 0, kinetic = 0;
  for (const SliderCrankState& state : run) {
    worst = std::max(worst, std::abs(state.energy - run.front().energy));
    kinetic = std::max(kinetic, state.energy - reference.state(state.time, state.theta, 0).energy);
  }
  return worst / kinetic;
}

// Oracle: conservation of energy; the class itself would throw beyond 1e-10.
TEST(SliderCrankReference, KeepsItsEnergyToOneInTenBillion) {
  EXPECT_LT(energy_error(SliderCrankSpec::iftomm(), 5), 1e-10);
  EXPECT_LT(energy_error(SliderCrankSpec::constant_torque(), 2), 1e-10);
}

// Oracle: a central difference of the slider's position.
TEST(SliderCrankReference, HasASliderVelocityThatIsTheSlopeOfItsPosition) {
  const SliderCrankReference reference(SliderCrankSpec::iftomm());
  for (double theta = 0; theta < 6.2; theta += 0.31) {
    const double slope =
        (reference.state(0, theta + 1e-5, 1).x - reference.state(0, theta - 1e-5, 1).x) / 2e-5;
    EXPECT_NEAR(reference.state(0, theta, 1).vx, slope, 1e-9);
  }
}

// Oracle: the contract.
TEST(SliderCrankReference, RefusesARodTooShortToTurnThrough) {
  SliderCrankSpec spec;
  spec.rod_length = 0.2;
  EXPECT_THROW(SliderCrankReference{spec}, Error);
}

}  // namespace
}  // namespace handsim::study
