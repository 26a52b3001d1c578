// Measures of hard cases compared with closed forms, and verdicts of a study.
#include "stability/stability.h"

#include <gtest/gtest.h>

#include <cmath>

#include <nlohmann/json.hpp>

#include "scene_files.h"

namespace handsim::study {
namespace {

using simulation::Simulation;

constexpr double kG = 10;

/// A free body of 2 kg that moves at 3 m/s and rotates at 4 rad/s about a principal axis.
constexpr const char* kThrown =
    "bodies: [{name: thing, mass: 2, inertia: [0.1, 0.2, 0.25], position: [0, 0, 0], velocity: [3, 0, 0], "
    "angular_velocity: [0, 0, 4]}]\neffects: []\nduration: 0.5\n";

/// A horizontal slender rod of 0.1 m, hinged at its end.
std::string rod(const std::string& axis = "", const std::string& rest = "effects: [gravity]\n") {
  return "bodies: [{name: rod, mass: 0.12, inertia: [1e-4, 1e-6, 1e-4], position: [0, 0.05, 0], "
         "angular_velocity: "
         "[20, 0, 0], velocity: [0, 0, 1]}]\n"
         "joints: [{name: pin, type: hinge, parent: world, child: rod, position: [0, 0, 0], axes: [{name: "
         "swing, "
         "axis: [1, 0, 0]" +
         axis + "}]}]\ngravity: [0, 0, -10]\nduration: 0.5\n" + rest;
}

scene::Scene scene_from(const std::string& text) {
  return scene::compile_scene(parse_yaml(text, "test.yaml"));
}

MeasureSpec spec_of(const std::string& kind) {
  MeasureSpec spec;
  spec.kind = spec.name = kind;
  return spec;
}

std::optional<Figure> measured(const std::string& text, const MeasureSpec& spec) {
  const scene::Scene scene = scene_from(text);
  Measure measure(scene, spec);
  Simulation simulation(scene);
  measure.update(simulation);
  for (long i = 0; i < simulation.step_count(); ++i) {
    simulation.step();
    measure.update(simulation);
  }
  return measure.figure();
}

double value_of(const std::string& text, MeasureSpec spec) {
  const auto figure = measured(text, spec);
  EXPECT_TRUE(figure) << spec.kind;
  return figure ? figure->value : std::nan("");
}

// Oracle: uniform motion.
TEST(Measures, OfAFreeBodyAreThoseOfUniformMotion) {
  EXPECT_NEAR(value_of(kThrown, spec_of("top_speed")), 3, 1e-12);
  EXPECT_NEAR(value_of(kThrown, spec_of("first_speed")), 3, 1e-12);
  EXPECT_NEAR(value_of(kThrown, spec_of("rms_speed")), 3, 1e-12);
  EXPECT_NEAR(value_of(kThrown, spec_of("drift")), 1.5, 1e-12);
  EXPECT_NEAR(value_of(kThrown, spec_of("slip_speed")), 3, 1e-12);
  // ODE rotates by 2 atan(w h / 2) in each step.
  EXPECT_NEAR(value_of(kThrown, spec_of("turn")), 500 * 2 * std::atan(0.002), 1e-9);
  EXPECT_NEAR(value_of(kThrown, spec_of("energy_error")), 0, 1e-12);
  EXPECT_NEAR(value_of(kThrown, spec_of("momentum_error")), 0, 1e-12);
  EXPECT_EQ(value_of(kThrown, spec_of("completes")), 0);
  MeasureSpec late = spec_of("drift");
  late.from = 0.2, late.until = 0.4;
  EXPECT_NEAR(value_of(kThrown, late), 0.6, 1e-9);
  MeasureSpec off = spec_of("speed_error");
  off.body = "thing", off.expected = 2.5;
  EXPECT_NEAR(value_of(kThrown, off), 0.2, 1e-12);
}

// Oracle: semi-implicit Euler in free fall: after n steps the energy is smaller by m g^2 h t / 2; the largest
// kinetic energy is m (g t)^2 / 2, so the relative loss is h / t.
TEST(Measures, OfEnergyAreThoseOfFreeFallByTheMethod) {
  const std::string fall =
      "objects: [{name: ball, shape: sphere, radius: 0.1, mass: 1, position: [0, 0, 0]}]\neffects: "
      "[gravity]\n"
      "gravity: [0, 0, -10]\nduration: 0.5\n";
  EXPECT_NEAR(value_of(fall, spec_of("energy_loss")), 1e-3 / 0.5, 1e-9);
  EXPECT_NEAR(value_of(fall, spec_of("energy_error")), 1e-3 / 0.5, 1e-9);
  EXPECT_NEAR(value_of(fall, spec_of("energy_gain")), 0, 1e-12);
  EXPECT_NEAR(value_of(fall, spec_of("energy_rise")), 0, 1e-12);
}

// Oracle: closed forms. Without the effect joint_stops, the rod rotates past the stop by half a turn plus
// less than a step's 0.02 rad, and its angle wraps (w t + pi) / 2 pi times.
TEST(Measures, OfStopsDetectAMissingStop) {
  MeasureSpec late = spec_of("stop_late");
  late.joint = "pin";
  const std::string open = rod(", range: [-3, 0.3]", "effects: []\n");
  // Until the angle wraps.
  EXPECT_NEAR(value_of(open, late), M_PI - 0.3, 0.03);
  MeasureSpec wraps = spec_of("wraps");
  wraps.joint = "pin";
  EXPECT_EQ(value_of(open, wraps), std::floor((20 * 0.5 + M_PI) / (2 * M_PI)));
}

// Oracle: Newton's law of restitution.
TEST(Measures, OfReboundCompareWithTheStopsBounce) {
  MeasureSpec rebound = spec_of("rebound_error");
  rebound.joint = "pin";
  for (const char* bounce : {"0", "0.5"})
    EXPECT_LT(value_of(rod(std::string(", range: [-3, 0.3], bounce: ") + bounce, "effects: [joint_stops]\n"),
                       rebound),
              0.05);
  EXPECT_FALSE(
      measured("bodies: [{name: rod, mass: 0.12, inertia: [1e-4, 1e-6, 1e-4], position: [0, 0.05, 0]}]\n"
               "joints: [{name: pin, type: hinge, parent: world, child: rod, position: [0, 0, 0], axes: "
               "[{name: swing, axis: [1, 0, 0], range: [-1, 1]}]}]\neffects: [joint_stops]\nduration: 0.1\n",
               rebound))
      << "a joint at rest has no rebound";
}

// Oracle: a slender rod released horizontally: alpha = 3 g / (2 l) = 150 rad/s^2, and the hinge carries a
// quarter of the weight.
TEST(Measures, OfAFallingRodAreThoseOfMechanics) {
  const std::string rest =
      "bodies: [{name: rod, mass: 0.12, inertia: [1e-4, 1e-6, 1e-4], position: [0, 0.05, 0]}]\n"
      "joints: [{name: pin, type: hinge, parent: world, child: rod, position: [0, 0, 0], axes: [{name: "
      "swing, axis: "
      "[1, 0, 0]}]}]\ngravity: [0, 0, -10]\neffects: [gravity]\nduration: 0.001\n";
  // Tolerance: the compliance of the CFM.
  EXPECT_NEAR(value_of(rest, spec_of("acceleration")), 150, 1e-4);
  MeasureSpec reaction = spec_of("reaction_error");
  reaction.joint = "pin";
  EXPECT_NEAR(value_of(rest, reaction), 0.75, 1e-6);
}

// Oracle: the speed of a sliding box is g (sin a - mu cos a) t with Coulomb friction, and g sin a t without.
TEST(Measures, OfAnInclineCompareWithCoulomb) {
  const double a = 35 * M_PI / 180;
  const auto scene = [&](const char* effects) {
    return "objects: [{name: box, shape: box, edges: [0.04, 0.04, 0.04], mass: 0.1, position: [0, 0, "
           "0.01999], "
           "friction: 0.5}]\nground: {friction: 0.5}\ngravity: [" +
           number_text(kG * std::sin(a)) + ", 0, " + number_text(-kG * std::cos(a)) +
           "]\nduration: 0.2\neffects: [" + effects + "]\n";
  };
  MeasureSpec slide = spec_of("slide_error");
  slide.body = "box";
  EXPECT_LT(value_of(scene("gravity, ground_contact, friction"), slide), 1e-9);
  const double coulomb = std::sin(a) - 0.5 * std::cos(a);
  EXPECT_NEAR(value_of(scene("gravity, ground_contact"), slide), std::sin(a) / coulomb - 1, 1e-6);
  MeasureSpec deep = spec_of("penetration");
  EXPECT_NEAR(value_of(scene("gravity, ground_contact, friction"), deep), 1e-5, 1e-9);
}

/// A study of the free body; `ways` and `known` as YAML lists.
struct Study {
  test::TemporaryFolder folder;
  StabilitySpec spec;

  Study(const std::string& measures, const std::string& ways, const std::string& more = "") {
    std::ofstream(folder.path() / "thing.yaml") << kThrown;
    std::ofstream(folder.path() / "study.yaml")
        << "cases:\n  - name: thrown\n    title: a thing is thrown\n    oracle: uniform motion\n"
           "    scene: thing.yaml\n    steps: [\"1 ms\"]\n    measures: "
        << measures << "\n    ways: " << ways << "\n"
        << more;
    spec = load_stability(folder.path() / "study.yaml");
  }
};

constexpr const char* kWays =
    "[{name: slow, set: {bodies.0.velocity: [1, 0, 0]}}, {name: fast, set: {bodies.0.velocity: [5, 0, 0]}}]";

// Oracle: the definition of the verdicts.
TEST(StabilityStudy, FailsForUnknownShortfalls) {
  const char* measures = "[{measure: top_speed, limit: \"2 m/s\"}]";
  const Study unknown(measures, kWays);
  const StabilityResult failed = run_stability(unknown.spec, {});
  EXPECT_FALSE(failed.passed());
  ASSERT_EQ(failed.cases[0].rows.size(), 2U);
  EXPECT_EQ(failed.cases[0].rows[0].verdict, StabilityVerdict::held);
  EXPECT_EQ(failed.cases[0].rows[1].verdict, StabilityVerdict::fell_short);
  EXPECT_NEAR(*failed.cases[0].rows[1].value, 5, 1e-12);
  EXPECT_NEAR(failed.cases[0].rows[1].severity(), 2.5, 1e-12);

  const Study known(measures, kWays,
                    "    known_short: [{way: fast, measures: [top_speed], why: it is fast}]\n");
  const StabilityResult passed = run_stability(known.spec, {});
  EXPECT_TRUE(passed.passed());
  EXPECT_EQ(passed.cases[0].rows[1].verdict, StabilityVerdict::known_short);
  const std::string table = stability_table(passed);
  EXPECT_NE(table.find("known: fast: it is fast"), std::string::npos) << table;
  EXPECT_NE(table.find("top_speed holds with slow 1 ms"), std::string::npos) << table;

  const Study better("[{measure: top_speed, limit: \"20 m/s\"}]", kWays,
                     "    known_short: [{way: fast, measures: [top_speed], why: it is fast}]\n");
  const StabilityResult held = run_stability(better.spec, {});
  EXPECT_TRUE(held.passed());
  EXPECT_EQ(held.cases[0].rows[1].verdict, StabilityVerdict::better);
}

// Oracle: the definition; the table shows the worst variant, files contain all.
TEST(StabilityStudy, ShowsTheWorstVariantAndWritesAll) {
  const Study study(
      "[{measure: top_speed, limit: \"6 m/s\"}]", "[{name: any}]",
      "    vary: [{key: \"bodies.0.velocity\", label: v, values: [[1, 0, 0], [5, 0, 0], [4, 0, 0]]}, "
      "{of: [{name: long, set: {duration: 0.2}}, {name: short, set: {duration: 0.1}}]}]\n");
  StabilityOptions options;
  options.threads = 2;
  const StabilityResult result = run_stability(study.spec, options);
  ASSERT_EQ(result.cases[0].rows.size(), 6U);
  const std::vector<StabilityRow> worst = worst_rows(result.cases[0]);
  ASSERT_EQ(worst.size(), 1U);
  EXPECT_EQ(worst[0].variant, "v [5, 0, 0], long");
  write_stability(study.spec, result, study.folder.path() / "out");
  const auto json = nlohmann::json::parse(test::text_of(study.folder.path() / "out/stability.json"));
  EXPECT_EQ(json["cases"][0]["rows"].size(), 6U);
  EXPECT_EQ(json["passed"], true);
  const std::string csv = test::text_of(study.folder.path() / "out/stability.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 7);
}

// Oracle: the definition; a rejection must have the expected message; a fault has a time.
TEST(StabilityStudy, ChecksRejectionsAndFaults) {
  const Study study("[{measure: completes, limit: 0}]",
                    "[{name: good}, {name: refused, set: {bodies.0.mass: -1}, refused: bodies.0.mass}, "
                    "{name: accepted, set: {bodies.0.mass: 1}, refused: bodies.0.mass}, "
                    "{name: other reason, set: {bodies.0.mass: -1}, refused: bodies.0.inertia}]");
  const StabilityResult result = run_stability(study.spec, {});
  std::vector<StabilityVerdict> verdicts;
  for (const StabilityRow& row : result.cases[0].rows) verdicts.push_back(row.verdict);
  EXPECT_EQ(verdicts, (std::vector{StabilityVerdict::held, StabilityVerdict::held,
                                   StabilityVerdict::fell_short, StabilityVerdict::fell_short}));

  const Study diverges("[{measure: completes, limit: 0}]",
                       "[{name: too fast, set: {gravity: [1000, 0, 0], effects: [gravity], duration: 2}}]");
  const StabilityRow row = run_stability(diverges.spec, {}).cases[0].rows[0];
  EXPECT_EQ(row.verdict, StabilityVerdict::fell_short);
  EXPECT_FALSE(row.value);
  ASSERT_TRUE(row.time);
  // With 1000 m/s^2 from 3 m/s, the limit of 1000 m/s is reached after 0.997 s.
  EXPECT_NEAR(*row.time, 0.998, 2e-3);
  EXPECT_NE(row.fault.find("thing"), std::string::npos);
}

// Oracle: the contract: all problems at once, before any run.
TEST(StabilityStudy, ReportsEveryInvalidWayBeforeAnyRun) {
  const Study study("[{measure: completes, limit: 0}]",
                    "[{name: good}, {name: light, set: {bodies.0.mass: -1}}, {name: mixed, set: "
                    "{solver.engine: articulated, solver.projection: true}}]");
  StabilityOptions options;
  int ran = 0;
  options.progress = [&](double) { ++ran; };
  try {
    run_stability(study.spec, options);
    FAIL() << "accepted";
  } catch (const Error& error) {
    const std::string said = error.what();
    EXPECT_NE(said.find("thrown (light): bodies.0.mass"), std::string::npos) << said;
    EXPECT_NE(said.find("thrown (mixed): solver.projection"), std::string::npos) << said;
  }
  EXPECT_EQ(ran, 0);
}

// Oracle: a seed gives the same variants, another seed others; each value is in its range.
TEST(StabilityStudy, RandomVariantsAreReproducible) {
  using From = DrawnKey::From;
  Draws draws{5,
              3,
              {{"a", From::range, 1, 2, {}},
               {"b", From::choices, 0, 0, {"x", "y"}},
               {"c", From::person, 0, 0, {}},
               {"d", From::person, 0, 0, {}},
               {"e", From::rotation, 0, 0, {}}}};
  const std::vector<Alternative> first = drawn_variants(draws, 5), again = drawn_variants(draws, 3);
  ASSERT_EQ(first.size(), 5U);
  ASSERT_EQ(again.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(first[i].set, again[i].set);
  for (const Alternative& each : first) {
    ASSERT_EQ(each.set.size(), 5U);
    const double a = std::stod(each.set[0].substr(2));
    EXPECT_TRUE(1 <= a && a <= 2) << a;
    EXPECT_TRUE(each.set[1] == "b=x" || each.set[1] == "b=y");
    EXPECT_EQ(each.set[2].substr(2), each.set[3].substr(2));
    EXPECT_EQ(each.set[4].rfind("e={axis: [", 0), 0U);
  }
  EXPECT_NE(first[0].set, first[1].set);
  draws.seed = 4;
  EXPECT_NE(drawn_variants(draws, 1)[0].set, first[0].set);
}

// Oracle: the contract of `draws`: one run for each random variant; an invalid range is reported with its
// place.
TEST(StabilityStudy, RunsItsRandomVariants) {
  const Study study("[{measure: completes, limit: 0}]", "[{name: any}]",
                    "    draws: {count: 5, seed: 3, set: {duration: [0.01, 0.02]}}\n");
  const StabilityResult result = run_stability(study.spec, {});
  ASSERT_EQ(result.cases[0].rows.size(), 5U);
  EXPECT_EQ(result.cases[0].rows[4].variant, "draw 5");
  try {
    const Study bad("[{measure: completes, limit: 0}]", "[{name: any}]",
                    "    draws: {count: 5, set: {duration: [0.02, 0.01]}}\n");
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("draws.set.duration: got "), std::string::npos) << error.what();
  }
}

// Oracle: the contract of --case.
TEST(StabilityStudy, KnowsItsCasesByName) {
  const Study study("[{measure: completes, limit: 0}]", "[{name: any}]");
  StabilityOptions options;
  options.cases = {"thrwn"};
  try {
    run_stability(study.spec, options);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("got thrwn, need one of thrown (nearest: thrown)"),
              std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace handsim::study
