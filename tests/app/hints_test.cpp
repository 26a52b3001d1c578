// What a message or a schema tells its reader: hints that work, names of shipped files, hands of one's own
// with shipped controllers. Oracle: the messages by hand, and the program itself, which takes what it
// suggests.
#include <functional>
#include <map>
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

/// Asked for once: that of a scene takes a second.
const Json& schema_of(const std::string& kind) {
  static std::map<std::string, Json> known;
  const auto [at, is_new] = known.try_emplace(kind);
  if (is_new) at->second = Json::parse(run_program({"schema", kind}).out);
  return at->second;
}

TEST(Schema, EveryKeySaysWhatItMeans) {
  // What a value must be is no meaning: "a number of [m], such as 0.1".
  const auto only_a_value = [](const std::string& text) {
    const bool begins = text.starts_with("a ") || text.starts_with("an ") || text.starts_with("one of ") ||
                        text.starts_with("the path of ");
    return begins && text.substr(0, text.find(':')).find(", such as") != std::string::npos;
  };
  std::set<std::string> without;
  std::size_t count = 0;
  for (const std::string& kind : kKinds) {
    // Every part of the reader is asked for it: with a sanitizer it takes half a minute, and other tests ask
    // the parts.
    if (test::kSanitized && kind == "scene") continue;
    each_property(schema_of(kind), kind, [&](const std::string& path, const Json& property) {
      ++count;
      const std::string text = property.value("description", std::string());
      if (text.empty() || only_a_value(text)) without.insert(path);
    });
  }
  EXPECT_GT(count, test::kSanitized ? 300U : 1000U);
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
  const Outcome misspelt = run_program({"run", "two_hnds", "--out", (folder.path() / "none").string()});
  EXPECT_EQ(misspelt.status, 2);
  EXPECT_EQ(misspelt.problems(),
            std::vector<std::string>{
                "\"two_hnds\": got no such file, and no shipped one of this name, need a file, "
                "or the name of a shipped one (nearest: two_hands)"});
}

/// The first block of YAML after a heading of README.md.
std::string example_of_readme() {
  const std::string text = test::text_of(source("README.md"));
  const std::size_t begin = text.find("```yaml\n") + 8;
  return text.substr(begin, text.find("```", begin) - begin);
}

TEST(ShippedFiles, TheReadmesSceneRunsFromAnEmptyFolder) {
  const TemporaryFolder folder;
  const auto scene = write(folder.path() / "ball.yaml", example_of_readme());
  const Outcome outcome = run_program(
      {"run", scene, "--out", folder.path() / "out", "--set", "duration=0.02", "--set", "criteria={}"});
  EXPECT_TRUE(outcome.problems().empty()) << outcome.err;
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "out/summary.json"));
}

/// A scene in a folder of its own, without paths.
const char* const kByNames =
    "hands: [{model: elder, person: child, side: right, wrist: {mount: fixed}}]\n"
    "objects: [{name: m, file: mug, position: [0.5, 0, 0]}]\n"
    "control: {controller: integral, poses: poses, program: every_pose, motion: {names: names_arms}}\n"
    "effects: [gravity, joint_stops, actuation]\nduration: 0.02\n";

TEST(ShippedFiles, AreTakenByNameWhereverASceneNamesAFile) {
  const TemporaryFolder folder;
  const std::string scene = write(folder.path() / "s.yaml", kByNames);
  EXPECT_TRUE(run_program({"check", scene}).problems().empty()) << run_program({"check", scene}).err;
  const Outcome outcome =
      run_program({"run", scene, "--out", folder.path() / "out", "--set", "hands.0.person=giant", "--set",
                   "hands.0.person.hand_mass=0.7", "--quiet"});
  EXPECT_TRUE(outcome.problems().empty()) << outcome.err;
  const std::string resolved = test::text_of(folder.path() / "out/resolved.yaml");
  EXPECT_TRUE(contains(resolved, "hand_mass: 0.7")) << resolved.substr(0, 500);
}

TEST(ShippedFiles, TheHandModelMayBeMissing) {
  const TemporaryFolder folder;
  std::string named = std::regex_replace(kByNames, std::regex("elder"), "anatomical");
  std::string missing = std::regex_replace(kByNames, std::regex("model: elder, "), "");
  const auto hash = [&](const std::string& text) {
    const Outcome outcome =
        run_program({"run", write(folder.path() / "s.yaml", text), "--out", folder.path() / "out", "--json"});
    return Json::parse(outcome.out).at("state_hash").get<std::string>();
  };
  EXPECT_EQ(hash(named), hash(missing));
}

TEST(ShippedFiles, AFileOfTheUserComesFirst) {
  const TemporaryFolder folder;
  const std::string own = write(folder.path() / "child", "{stature: 9, mass: 30, sex: female}\n");
  const Outcome outcome = run_program({"check", write(folder.path() / "s.yaml", kByNames)});
  ASSERT_EQ(outcome.problems().size(), 1U) << outcome.err;
  EXPECT_TRUE(contains(outcome.err, own + ":1:11: hands.0.person.stature: got 9")) << outcome.err;
}

TEST(ShippedFiles, AMisspeltNameGetsTheNearestOrAllOfItsKind) {
  const TemporaryFolder folder;
  write(folder.path() / "me.yaml", "{stature: 1.7, mass: 60, sex: female}\n");
  const auto with = [&](const char* person) {
    const std::string scene = std::regex_replace(kByNames, std::regex("child"), person);
    return write(folder.path() / "s.yaml", scene).string();
  };
  const std::string head = with("median_mann") + ":1:32: hands.0.person: got ";
  const std::string need =
      ", which is not a file, need the path of a YAML file, relative to this file, or the name of a shipped "
      "one";
  const auto said = [&](const char* person) { return run_program({"check", with(person)}).problems().at(0); };
  EXPECT_EQ(said("median_mann"), head + "median_mann" + need + " (nearest: median_man)");
  // A path of the source's folder.
  EXPECT_EQ(said("config/persons/giant.yaml"),
            head + "config/persons/giant.yaml" + need + " (nearest: giant)");
  EXPECT_EQ(said("me"), head + "me" + need + " (nearest: me.yaml)");
  EXPECT_TRUE(contains(said("xyz"), need + " (boy_14_years, ")) << said("xyz");
}

TEST(ShippedFiles, AreCheckedByTheNameOfAnyKind) {
  EXPECT_EQ(run_program({"check", "median_man", "mug", "elder", "implicit", "controllers/muscles"}).status,
            0);
  EXPECT_EQ(run_program({"check", "muscles"}).problems(),
            std::vector<std::string>{"\"muscles\": got the name of several shipped files, need one of "
                                     "controllers/muscles, handmodels/muscles"});
}

/// Runs the program in a folder.
Outcome in_folder(const std::filesystem::path& folder, const std::vector<std::string>& arguments) {
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder);
  Outcome outcome = run_program(arguments);
  std::filesystem::current_path(before);
  return outcome;
}

TEST(Out, HasADefaultForEveryCommandThatWrites) {
  const TemporaryFolder folder;
  struct Case {
    std::vector<std::string> arguments;
    const char* made;
  };
  for (const Case& each :
       {Case{{"run", "two_hands", "--set", "duration=0.01", "--quiet"}, "two_hands/summary.json"},
        Case{{"render", "two_hands"}, "two_hands.png"},
        Case{{"export", "two_hands", "--format", "urdf"}, "two_hands.urdf"},
        Case{{"export", "--person", "median_man"}, "export.xml"}}) {
    if (each.arguments[0] == "export" && std::string_view(HANDSIM_PYTHON_PROGRAM).empty()) continue;
    const Outcome outcome = in_folder(folder.path(), each.arguments);
    EXPECT_TRUE(std::filesystem::exists(folder.path() / "out" / each.made)) << each.made << outcome.err;
  }
}

TEST(LongCommand, ThatIsPipedSaysEveryTenSecondsHowFarItIs) {
  HANDSIM_SKIP_WITH_SANITIZER("time");
  const TemporaryFolder folder;
  // More than a minute on any machine: it is ended with its first such line, or after 30 s.
  const Outcome outcome = run_program({"run", "two_hands", "--out", folder.path() / "out", "--set",
                                       "duration=5000", "--set", "criteria={}", "--set", "record.every=10"},
                                      " left\n");
  const std::regex line("(^|\n)progress: [0-9]+ %, [0-9]+ (s|min) left\n");
  EXPECT_TRUE(std::regex_search(outcome.err, line)) << outcome.err;
}

TEST(Title, OfASceneWithAnotherObjectNamesIt) {
  const TemporaryFolder folder;
  const std::string scene =
      write(folder.path() / "s.yaml", std::string("title: a ball\n") + test::kBallScene);
  const auto title = [&](std::vector<std::string> sets) {
    std::vector<std::string> words = {"run", scene, "--out", folder.path() / "out", "--json"};
    sets.insert(sets.end(), {"duration=0.01"});
    for (const std::string& set : sets) words.insert(words.end(), {"--set", set});
    return Json::parse(run_program(words).out).at("title").get<std::string>();
  };
  EXPECT_EQ(title({"objects.0.mass=2"}), "a ball");
  EXPECT_EQ(title({"objects.0.shape=capsule", "objects.0.length=1"}), "a ball with objects.0.shape=capsule");
  EXPECT_EQ(title({"objects.0.shape=capsule", "objects.0.length=1", "title=a pill"}), "a pill");
}

TEST(View, NamesItsSceneNotItsTemporaryFolder) {
  if (std::string_view(HANDSIM_PYTHON_PROGRAM).empty()) GTEST_SKIP() << "built without the Python package";
  const TemporaryFolder folder;
  ::setenv("TMPDIR", folder.path().c_str(), 1);
  const Outcome outcome = run_program({"view", "two_hands", "--no-browser", "--set", "duration=0.02"});
  ::unsetenv("TMPDIR");
  const std::string mark = "open it in a browser: ";
  const std::size_t at = outcome.out.find(mark);
  ASSERT_NE(at, std::string::npos) << outcome.out << outcome.err;
  const std::size_t end = outcome.out.find('\n', at);
  const std::string page = test::text_of(outcome.out.substr(at + mark.size(), end - at - mark.size()));
  EXPECT_FALSE(contains(page, "/run-"));
  EXPECT_TRUE(contains(page, "two_hands.yaml\",\"title\""));
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
