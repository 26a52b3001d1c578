// A falling hand, without stops: two engines that share nothing but the Model come to the same motion.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/models.h"
#include "handsim/hand/build.h"
#include "support/slider_crank.h"

namespace handsim::engine {
namespace {

using model::Effect;
using test::settings;

/// The shipped anatomical hand, palm fixed or free, gravity across it.
model::Model anatomical_hand(hand::Mount mount) {
  YamlNode node = load_yaml(HANDSIM_SOURCE_DIR "/handmodels/anatomical.yaml");
  Diagnostics diagnostics;
  const hand::HandSpec spec = hand::read_hand_spec(node, "", diagnostics);
  diagnostics.throw_if_any();
  hand::Person person;
  person.stature = 1.755;
  person.mass = 84.5;
  person.sex = hand::Sex::male;
  model::Model model = model::make_model();
  hand::Placement placement;
  placement.mount = mount;
  placement.pose.q = rotation_quaternion({-0.4, 0.3, 0});
  placement.velocity = Vec3(0.3, 0, 0.5);
  placement.angular_velocity = Vec3(3, -2, 4);
  hand::add_hand(model, hand::build_hand(spec, person), placement);
  return model;
}

/// Joint coordinates after 0.2 s of gravity, tissue and small torques on every coordinate.
std::vector<double> fallen(const model::Model& model, Method method, double step) {
  const auto engine = make_engine(model, settings({Effect::gravity, Effect::passive_tissue}, step, method));
  std::vector<double> torques(static_cast<std::size_t>(model.dof_count()));
  for (std::size_t i = 0; i < torques.size(); ++i) torques[i] = i % 2 == 0 ? 2e-3 : -1e-3;
  for (long i = 0; i < std::lround(0.2 / step); ++i) engine->step({torques});
  if (method == Method::stabilised_gear) {
    EXPECT_LT(handsim::test::largest_gap(model, engine->state()), 1e-10);
  }
  return model::coordinates(model, engine->state());
}

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
  const std::vector<double> reference = fallen(model, Method::stabilised_gear, 1e-2);
  const double found = slope(model, Method::world_step, reference);
  RecordProperty("slope", std::to_string(found));
  EXPECT_NEAR(found, 1, 0.1);
}

// Oracle: the same for a hand thrown freely through the air, one island of 16 bodies.
TEST(ThrownHand, IsTheSameInOdeToFirstOrderInTheStep) {
  const model::Model model = anatomical_hand(hand::Mount::free);
  const std::vector<double> reference = fallen(model, Method::stabilised_gear, 1e-2);
  const double found = slope(model, Method::world_step, reference);
  RecordProperty("slope", std::to_string(found));
  EXPECT_NEAR(found, 1, 0.2);
}

// Oracle: order of convergence of each formulation towards the reference.
TEST(FallingHand, ConvergesInEveryFormulation) {
  const model::Model model = anatomical_hand(hand::Mount::fixed);
  const std::vector<double> reference = fallen(model, Method::stabilised_gear, 1e-2);
  EXPECT_NEAR(slope(model, Method::euler_linearised, reference), 1, 0.1);
  EXPECT_NEAR(slope(model, Method::euler_projected, reference), 1, 0.1);
  EXPECT_NEAR(slope(model, Method::lagrange_penalty, reference), 2, 0.3);
}

}  // namespace
}  // namespace handsim::engine
