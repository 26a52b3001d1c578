// The largest grip by muscles of people drawn from a population.
#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "handsim/hand/build.h"
#include "handsim/study/rollouts/population.h"
#include "handsim/study/validate/validate.h"
#include "scene_files.h"
#include "support/sanitized.h"

namespace handsim::study {
namespace {

constexpr int kPeople = 16;

/// A row of the grip on the dynamometer's bar beside the norm of the person's sex, age and stature. The bar
/// is at the hand of this size as in the rows of config/validate.yaml.
std::string row_of(const hand::HandSpec& spec, const hand::Person& person) {
  const hand::GripStrength norm = hand::grip_strength(spec.muscles->norms, person);
  const double length = hand::build_hand(spec, person).size.length;
  const std::string body = fmt::format("{{stature: {}, mass: {}, sex: {}, age: {}}}", person.stature,
                                       person.mass, hand::name(person.sex), hand::kDefaultAge);
  return fmt::format(
      "  - {{name: grip, kind: grip_force, friction: 0.6, tilts: [55 deg], scene: {}, set: "
      "[\"hands.0.person={}\", "
      "\"objects.0.position=[0, {}, {}]\"], pose: {{wrist.flexion: -35 deg, wrist.deviation: -7 deg}}, "
      "balanced: "
      "[wrist.flexion, wrist.deviation], measured: {}, spread: {}, source: norm, of: people, spread_is: "
      "source, "
      "value_is: norm}}\n",
      test::source("config/muscle_grip.yaml").string(), body, 0.0311 + 0.233 * length,
      -0.0218 - 0.0854 * length, norm.own, norm.deviation);
}

struct Moments {
  double mean = 0, deviation = 0;
};

Moments moments(const std::vector<double>& values) {
  Moments out;
  const auto n = static_cast<double>(values.size());
  for (const double value : values) out.mean += value / n;
  for (const double value : values) out.deviation += (value - out.mean) * (value - out.mean) / (n - 1);
  out.deviation = std::sqrt(out.deviation);
  return out;
}

// Oracle: Steiber 2016 by sex, age and stature. Forces of muscles are fitted to one man's grip.
TEST(Grip, OfAPopulationHasTheMeanAndTheScatterOfTheNorm) {
  HANDSIM_SKIP_WITH_SANITIZER("tests of muscles and of rows that are simulations run the same code");
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "grips.yaml";
  std::ofstream out(file);
  out << "hand: " << test::source("handmodels/anatomical.yaml").string()
      << "\npeople: {man: " << test::source("config/persons/median_man.yaml").string()
      << "}\nmeasurements:\n";
  YamlNode root = load_yaml(test::source("handmodels/anatomical.yaml"));
  Diagnostics diagnostics;
  const hand::HandSpec spec = hand::read_hand_spec(root, "", diagnostics);
  diagnostics.throw_if_any();
  for (int i = 0; i < kPeople; ++i) {
    environment::Draws draws(1, static_cast<std::uint64_t>(i), "person");
    out << row_of(spec, draw_person(*population("ansur2"), {}, draws));
  }
  out.close();
  const ValidateSpec rows = load_validate(file);
  const ValidateResult result = run_validate(rows);
  std::vector<double> ours, norms, differences;
  for (const ValidateRow& row : result.rows) {
    ours.push_back(row.ours);
    norms.push_back(row.of->value);
    differences.push_back((row.ours - row.of->value) / row.of->spread);
  }
  EXPECT_LT(std::abs(moments(differences).mean), 1);  // survey's standard deviations
  // Everybody has the norm's strength, so that grips scatter by sex and stature as norms do. Tolerance: one
  // standard error of the deviation of 16 normal numbers, 1 / sqrt(2 x 15) = 0.18.
  EXPECT_NEAR(moments(ours).deviation / moments(norms).deviation, 1, 0.18);
}

}  // namespace
}  // namespace handsim::study
