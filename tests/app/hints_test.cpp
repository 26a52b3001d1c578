// What a message or a schema tells its reader: hints that work, names of shipped files, hands of one's own
// with shipped controllers. Oracle: the messages by hand, and the program itself, which takes what it
// suggests.
#include <functional>
#include <regex>
#include <set>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/program.h"
#include "support/sanitized.h"

namespace handsim {
namespace {

using test::contains;
using test::Outcome;
using test::run_program;
using test::source;
using test::TemporaryFolder;
using test::write;
using Json = nlohmann::json;

Outcome hand_of(const std::string& stature, const std::string& mass) {
  return run_program({"hand", "--stature", stature, "--mass", mass, "--sex", "male", "--side", "right"});
}

TEST(Hints, ABareNumberGetsTheUnitThatFits) {
  EXPECT_EQ(hand_of("175", "72").problems(),
            std::vector<std::string>{"--stature: got 175, need a length, 0.5 to 2.5 m, such as \"175 cm\""});
  EXPECT_EQ(hand_of("175 cm", "72").status, 0);
  EXPECT_EQ(hand_of("1.75", "72000").problems(),
            std::vector<std::string>{"--mass: got 72000, need a mass, 2 to 400 kg, such as \"72000 g\""});
  EXPECT_EQ(
      hand_of("17", "72").problems(),
      std::vector<std::string>{"--stature: got 17, need a length, 0.5 to 2.5 m, such as 1.75 or \"175 cm\""});
}

TEST(Hints, ADecimalPointIsSuggestedOnlyWhereItsNumberIsAccepted) {
  EXPECT_TRUE(contains(hand_of("1,75", "72").err, "need a decimal point in place of a comma: 1.75\n"));
  EXPECT_FALSE(contains(hand_of("17,5", "72").err, "17.5"));
}

/// Calls `visit` with the path and the schema of every property.
void each_property(const Json& schema, const std::string& path,
                   const std::function<void(const std::string&, const Json&)>& visit) {
  if (schema.is_array())
    for (const Json& each : schema) each_property(each, path, visit);
  if (!schema.is_object()) return;
  for (const char* part : {"items", "additionalProperties", "anyOf"})
    if (schema.contains(part)) each_property(schema[part], path, visit);
  for (const char* part : {"properties", "$defs"})
    if (schema.contains(part))
      for (const auto& [key, property] : schema[part].items()) {
        const std::string own = path + "." + key;
        if (part == std::string("properties")) visit(own, property);
        each_property(property, own, visit);
      }
}

const std::vector<std::string> kKinds = {"scene",    "person",   "hand",          "controller", "poses",
                                         "object",   "material", "anthropometry", "grip_norms", "muscles",
                                         "rollouts", "names",    "measurements",  "markers",    "costs"};

Json schema_of(const std::string& kind) { return Json::parse(run_program({"schema", kind}).out); }

TEST(Schema, EveryKeySaysWhatItMeans) {
  std::set<std::string> without;
  std::size_t count = 0;
  for (const std::string& kind : kKinds)
    each_property(schema_of(kind), kind, [&](const std::string& path, const Json& property) {
      ++count;
      const std::string text = property.value("description", std::string());
      // What a value must be is no meaning.
      if (text.empty() || std::regex_search(text, std::regex("^(an?|one of|the path of) [^:]*, such as")))
        without.insert(path);
    });
  EXPECT_GT(count, 1000U);
  EXPECT_TRUE(without.empty()) << without.size() << " of " << count << ": " << Json(without).dump();
}

TEST(Schema, EveryExampleIsWithinItsRange) {
  HANDSIM_SKIP_WITH_SANITIZER("another test reads the same schemas");
  const std::regex example(R"(such as ([-+.e0-9]+) or "([-+.e0-9]+) ([^"]+)\")");
  std::size_t count = 0;
  for (const std::string& kind : kKinds)
    each_property(schema_of(kind), kind, [&](const std::string& path, const Json& property) {
      std::smatch found;
      const std::string text = property.value("description", std::string());
      if (!std::regex_search(text, found, example)) return;
      ++count;
      const double value = std::stod(found[1]);
      EXPECT_GE(value, property.value("minimum", -1e300)) << path << ": " << text;
      EXPECT_GT(value, property.value("exclusiveMinimum", -1e300)) << path << ": " << text;
      EXPECT_LE(value, property.value("maximum", 1e300)) << path << ": " << text;
    });
  EXPECT_GT(count, 100U);
}

/// Problems of a scene text.
std::string problems_of(const std::string& scene) {
  const TemporaryFolder folder;
  std::string all;
  for (const std::string& line : run_program({"check", write(folder.path() / "s.yaml", scene)}).problems())
    all += line.substr(line.find("s.yaml:") + 7) + "\n";
  return all;
}

TEST(Hints, WordsOfTheSameMeaning) {
  const std::string said = problems_of(
      "objects: [{name: b, shape: sphere, diameter: 0.1, weight: 1, colour: red, pos: [0, 0, 0]}]\nduration: "
      "1\n");
  for (const char* hint :
       {"(nearest: radius, half of it)", "(nearest: mass)", "(nearest: color)", "(nearest: position)"})
    EXPECT_TRUE(contains(said, hint)) << hint << "\n" << said;
}

TEST(Grasp, OfAnUnknownObjectIsOneProblem) {
  const TemporaryFolder folder;
  std::string text = test::text_of(source("config/grasp_sphere_70mm.yaml"));
  text = std::regex_replace(text, std::regex("object: \\w+"), "object: bal");
  text = std::regex_replace(text, std::regex("\\.\\./"), source("").string());
  text = std::regex_replace(text, std::regex("(persons|objects)/"), source("config/$1/").string());
  const Outcome outcome = run_program({"check", write(folder.path() / "s.yaml", text)});
  ASSERT_EQ(outcome.problems().size(), 1U) << outcome.err;
  EXPECT_TRUE(contains(outcome.err,
                       "grasps.0.object: got bal, which is no object of the scene, need a free object "
                       "of the scene: ball"))
      << outcome.err;
}

TEST(HandModel, SizesThatAreTooSmallOrLargeNameTheirKey) {
  const TemporaryFolder folder;
  for (const char* model : {"anatomical", "prototype"})
    for (const char* size : {"1e-9", "0.000000001 HB",
                             "0.5 m + 0.5 m + 0.5 m + 0.5 m + 0.5 m + 0.5 m + 0.5 m + 0.5 m + "
                             "2 HL + 2 HL + 2 HL + 2 HL + 2 HL + 2 HL + 2 HL + 2 HL + 2 HL + "
                             "2 HL + 2 HL + 2 HL + 2 HL + 2 HL + 2 HL + 2 HL + 2 HL"}) {
      const auto file = write(folder.path() / "hand.yaml",
                              std::string("based_on: ") + source("handmodels/").string() + model +
                                  ".yaml\nsegments: [{name: index_proximal, radius: " + size + "}]\n");
      const Outcome outcome = run_program(
          {"hand", "--stature", "1.75", "--mass", "72", "--sex", "male", "--model", file.string()});
      EXPECT_EQ(outcome.status, 2);
      EXPECT_TRUE(contains(outcome.err, "segments.3.radius: got ")) << outcome.err;
      EXPECT_TRUE(contains(outcome.err, "need above 0.01 mm, at most 10 m")) << outcome.err;
    }
}

// 40,000 terms took 14 s when each term searched the rest of the text.
TEST(HandModel, ALongSumIsReadInTimeThatGrowsWithItsLength) {
  const TemporaryFolder folder;
  std::string sum = "1e-7 HL";
  for (int i = 1; i < 400'000; ++i) sum += " + 1e-7 HL";
  const auto file =
      write(folder.path() / "hand.yaml", "based_on: " + source("handmodels/anatomical.yaml").string() +
                                             "\nsegments: [{name: index_distal, length: \"" + sum + "\"}]\n");
  EXPECT_EQ(run_program({"check", file.string()}).status, 0);
}

TEST(ShippedFiles, AreFoundByTheirNames) {
  const TemporaryFolder folder;
  EXPECT_EQ(run_program({"check", "two_hands", "persons/child", "stability/chain"}).status, 0);
  EXPECT_EQ(run_program({"run", "two_hands", "--out", (folder.path() / "out").string(), "--set",
                         "duration=0.01", "--quiet"})
                .problems(),
            std::vector<std::string>{});
  EXPECT_EQ(run_program({"hand", "--person", "child", "--model", "prototype"}).status, 0);
  const Outcome misspelt = run_program({"run", "two_hnds", "--out", (folder.path() / "none").string()});
  EXPECT_EQ(misspelt.status, 2);
  EXPECT_EQ(misspelt.problems(),
            std::vector<std::string>{
                "\"two_hnds\": got no such file, and no shipped one of this name, need a file, "
                "or the name of a shipped one (nearest: two_hands)"});
}

/// A scene with this hand model, a shipped controller and shipped poses.
std::string scene_with(const std::string& model, const std::string& controller, const std::string& poses) {
  const std::string root = source("").string();
  return "hands: [{model: " + model + ", person: " + root +
         "config/persons/median_man.yaml, side: right, wrist: {mount: hinge}}]\ncontrol: {controller: " +
         root + "controllers/" + controller + ", poses: " + poses +
         ", program: p}\neffects: [gravity, joint_stops, actuation]\nduration: 0.02\n";
}

TEST(ShippedControllers, DriveAHandOfOnesOwn) {
  const TemporaryFolder folder;
  const std::string model = source("tests/data/hands/three_fingers.yaml");
  const std::string poses =
      "{poses: {open: {}, shut: {a_one: 0.5, c_one: 0.3}}, programs: {p: {keys: [{time: 0, pose: shut}]}}}";
  for (const char* controller : {"implicit.yaml", "feed_forward.yaml", "integral.yaml", "explicit.yaml"}) {
    const auto scene = write(folder.path() / "s.yaml", scene_with(model, controller, poses));
    const Outcome outcome =
        run_program({"run", scene.string(), "--out", (folder.path() / "out").string(), "--json"});
    EXPECT_EQ(outcome.status, 0) << controller << outcome.err;
    // The wrist and five joints; the rows of others are left out.
    std::size_t driven = 0;
    for (std::size_t at = 0; (at = outcome.out.find("proportional_N_m_per_rad", at)) != std::string::npos;
         ++at)
      ++driven;
    EXPECT_EQ(driven, 6U) << controller;
    EXPECT_TRUE(contains(outcome.err, "left out: index_mcp, ")) << outcome.err;
  }
}

TEST(ShippedControllers, RefuseAMisspeltJointOfACopy) {
  const TemporaryFolder folder;
  std::string text = test::text_of(source("controllers/implicit.yaml"));
  text.replace(text.find("[index_mcp], torque"), 11, "[index_mpc]");
  write(folder.path() / "c.yaml", text);
  std::string scene = scene_with(source("handmodels/anatomical.yaml"), "", source("controllers/poses.yaml"));
  scene = std::regex_replace(scene, std::regex("controller: [^,]*"), "controller: c.yaml");
  scene = std::regex_replace(scene, std::regex("program: p"), "program: every_pose");
  const Outcome outcome = run_program({"check", write(folder.path() / "s.yaml", scene).string()});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_TRUE(contains(outcome.err,
                       "\"index_mpc\", a joint that no hand of the scene has, need a joint or joint.axis "
                       "of a hand (nearest: index_mcp)"))
      << outcome.err;
}

TEST(ShippedPoses, FitAHandOfFourFingers) {
  const TemporaryFolder folder;
  // The anatomical hand without its little finger.
  const std::string anatomical = test::text_of(source("handmodels/anatomical.yaml"));
  std::string four = anatomical.substr(0, anatomical.find("  - name: little_proximal"));
  four = std::regex_replace(four, std::regex("anthropometry: "),
                            "anthropometry: " + source("handmodels/").string());
  const std::string model = write(folder.path() / "four.yaml", four).string();
  std::string scene = scene_with(model, "implicit.yaml", source("controllers/poses.yaml"));
  scene = std::regex_replace(scene, std::regex("program: p"), "program: every_pose");
  const Outcome outcome = run_program({"check", write(folder.path() / "s.yaml", scene).string()});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_TRUE(contains(outcome.err, "hand right has no joint little_mcp: left out")) << outcome.err;
}

}  // namespace
}  // namespace handsim
