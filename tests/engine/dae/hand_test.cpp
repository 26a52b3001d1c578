// A falling hand without stops: two independent engines converge to the same motion.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/shared_motions.h"
#include "support/sanitized.h"

namespace handsim::engine {
namespace {

using test::fallen;

/// The shipped anatomical hand.
model::Model anatomical_hand(hand::Mount mount) { return test::shipped_hand("anatomical.yaml", mount); }

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum / static_cast<double>(a.size()));
}

/// Slope of a method's distance from the reference between 1 ms and 0.1 ms.
double slope(const model::Model& model, Method method, const std::vector<double>& reference) {
  const double coarse = distance(fallen(model, method, 1e-3), reference);
  const double fine = distance(fallen(model, method, 1e-4), reference);
  return std::log10(coarse / fine);
}

// Oracle: order of convergence towards an independent engine: first order in the step.
TEST(FallingHand, IsTheSameInOdeToFirstOrderInTheStep) {
  const model::Model model = anatomical_hand(hand::Mount::fixed);
  const std::vector<double> reference = fallen(model, DaeMethod::stabilised_gear, 1e-2);
  const double found = slope(model, OdeMethod::world_step, reference);
  RecordProperty("slope", std::to_string(found));
  EXPECT_NEAR(found, 1, 0.1);
}

// Oracle: the same for a free hand, one island of 16 bodies.
TEST(ThrownHand, IsTheSameInOdeToFirstOrderInTheStep) {
  const model::Model model = anatomical_hand(hand::Mount::free);
  const std::vector<double> reference = fallen(model, DaeMethod::stabilised_gear, 1e-2);
  const double found = slope(model, OdeMethod::world_step, reference);
  RecordProperty("slope", std::to_string(found));
  EXPECT_NEAR(found, 1, 0.2);
}

// Oracle: order of convergence of each formulation towards the reference.
TEST(FallingHand, ConvergesInEveryFormulation) {
  HANDSIM_SKIP_WITH_SANITIZER("SliderCrank runs every formulation");
  const model::Model model = anatomical_hand(hand::Mount::fixed);
  const std::vector<double> reference = fallen(model, DaeMethod::stabilised_gear, 1e-2);
  EXPECT_NEAR(slope(model, DaeMethod::euler_linearised, reference), 1, 0.1);
  EXPECT_NEAR(slope(model, DaeMethod::euler_projected, reference), 1, 0.1);
  EXPECT_NEAR(slope(model, DaeMethod::lagrange_penalty, reference), 2, 0.3);
}

}  // namespace
}  // namespace handsim::engine
