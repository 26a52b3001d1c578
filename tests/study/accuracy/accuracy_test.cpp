#include "handsim/study/accuracy/accuracy.h"

#include <gtest/gtest.h>

#include <cmath>

#include <nlohmann/json.hpp>

#include "scene_files.h"

namespace handsim::study {
namespace {

AccuracyMethod method(std::string name, std::vector<std::string> set, std::vector<double> steps) {
  return {std::move(name), std::move(set), std::move(steps), {}, {}, {}, {}};
}

AccuracySpec slider_crank(std::vector<AccuracyMethod> methods) {
  AccuracySpec spec = load_accuracy(test::source("config/accuracy_slider_crank.yaml"));
  spec.repeats = 1;
  spec.methods = std::move(methods);
  return spec;
}

// Bounds: the first measured errors were 0.14 and 0.0088 m/s.
TEST(AccuracySliderCrank, WorldStepIsWithin0_15At1MsAnd0_01AtATenthOfThat) {
  const AccuracyResult result =
      run_accuracy(slider_crank({method("m", {"solver.erp=0.2"}, {1e-3, 1e-4})}), nullptr);
  EXPECT_LE(result.rows[0].rate_error, 0.15);
  EXPECT_LE(result.rows[1].rate_error, 0.01);
  EXPECT_GT(result.rows[1].rate_error, 1e-6);
  EXPECT_GT(result.rows[1].cpu_per_second, result.rows[0].cpu_per_second);
}

// Oracle: the order of convergence of semi-implicit Euler, 1, over the first second.
TEST(AccuracySliderCrank, WorldStepIsOfFirstOrderAtErp0_8) {
  AccuracySpec spec = slider_crank({method("m", {"solver.erp=0.8"}, {1e-3, 5e-4, 1e-4})});
  spec.early = 1;
  const AccuracyResult result = run_accuracy(spec, nullptr);
  const double order = std::log10(result.rows[0].early_rate_error / result.rows[2].early_rate_error);
  EXPECT_GE(order, 0.8);
  EXPECT_LE(order, 1.2);
}

// Oracle: the reference has a row every 10 ms.
TEST(AccuracySliderCrank, IsNotComparedBetweenTheRowsOfItsReference) {
  AccuracySpec spec = slider_crank({method("m", {}, {1e-3})});
  spec.sample_every = 0.004;
  EXPECT_THROW(run_accuracy(spec, nullptr), Error);
}

TEST(AccuracySliderCrank, ProjectedEulerClosesTheLoopTo1e12) {
  const AccuracyResult result = run_accuracy(
      slider_crank({method("m", {"solver.engine=dae", "solver.method=euler_projected"}, {1e-3})}), nullptr);
  EXPECT_LE(result.rows[0].gap, 1e-12);
}

TEST(AccuracyRows, OfOneMethodWithoutAReferenceAreComparedWithTheSmallestStep) {
  AccuracySpec spec = slider_crank({method("m", {"duration=0.2"}, {2e-3, 1e-3, 5e-4})});
  spec.reference = Reference::smallest_step;
  const AccuracyResult result = run_accuracy(spec, nullptr);
  EXPECT_FALSE(result.rows[0].is_reference);
  EXPECT_TRUE(result.rows[2].is_reference);
  EXPECT_EQ(result.rows[2].rate_error, 0);
  EXPECT_GT(result.rows[0].rate_error, result.rows[1].rate_error);
}

// Its reference and its first row would take hours.
TEST(AccuracyRows, OfARefusedSceneEndTheStudyBeforeItsFirstRun) {
  AccuracySpec spec =
      slider_crank({method("long", {"duration=1e5"}, {1e-3}),
                    method("refused", {"solver.engine=dae", "effects=[joint_stops]"}, {1e-3})});
  spec.reference = Reference::method;
  spec.reference_set = {"duration=1e5"};
  EXPECT_THROW(run_accuracy(spec, nullptr), Error);
}

// Oracle: the numbers of the rows themselves, as JSON has them.
TEST(AccuracyRows, AsTextHaveEveryDigit) {
  AccuracySpec spec = slider_crank({method("it's", {"duration=0.2"}, {5e-3})});
  spec.plot_steps = {5e-3};
  const AccuracyResult result = run_accuracy(spec, nullptr);
  const auto json = nlohmann::json::parse(rows_text(spec, result));
  const AccuracyRow& row = result.rows.at(0);
  EXPECT_EQ(json["rows"][0]["rate_error"], row.rate_error);
  EXPECT_EQ(json["rows"][0]["cpu"], row.cpu_per_second);
  EXPECT_EQ(json["rows"][0]["series"]["rate"][20], row.series.rate.at(20).at(0));
  EXPECT_EQ(json["rows"][0]["series"]["rate"].size(), row.series.rate.size());
  ASSERT_TRUE(result.reference.has_value());
  ASSERT_EQ(json["reference"]["rate"].size(), result.reference->rate.size());
  EXPECT_EQ(json["reference"]["rate"][20], result.reference->rate.at(20).at(0));
  EXPECT_EQ(std::string(json["engines"][0]).substr(0, 8), "ODE 0.16");
}

}  // namespace
}  // namespace handsim::study
