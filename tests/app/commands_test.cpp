// The command line: invalid arguments, overrides, exit statuses, output and files of commands.
// Oracle: the README's exit statuses.
#include <algorithm>
#include <regex>

#include <gtest/gtest.h>

#include "app/program.h"

namespace handsim {
namespace {

using test::contains;
using test::empty_or_missing;
using test::Outcome;
using test::run_program;
using test::source;
using test::TemporaryFolder;
using test::write;
using Words = std::vector<std::string>;
namespace fs = std::filesystem;

const std::string kScene = source("config/two_hands.yaml");

/// Arguments that must give exit status 2 and one problem with this part.
struct Usage {
  const char* name;
  Words arguments;
  std::string part;
};

void PrintTo(const Usage& usage, std::ostream* out) { *out << usage.name; }

class BadUsage : public testing::TestWithParam<Usage> {};

TEST_P(BadUsage, IsRefusedWithOneMessage) {
  const bool of_package = !GetParam().arguments.empty() && GetParam().arguments[0] == "export";
  if (of_package && std::string_view(HANDSIM_PYTHON_PROGRAM).empty())
    GTEST_SKIP() << "built without the Python package";
  const TemporaryFolder folder;
  const std::string mark = "OUT";
  Words arguments = GetParam().arguments;
  for (std::string& argument : arguments)
    if (argument.starts_with(mark))
      argument = (folder.path() / ("out" + argument.substr(mark.size()))).string();
  const Outcome outcome = run_program(arguments);
  EXPECT_EQ(outcome.status, 2) << outcome.err;
  EXPECT_EQ(outcome.out, "");
  ASSERT_FALSE(outcome.problems().empty());
  const std::string problem = outcome.problems()[0];
  EXPECT_TRUE(contains(problem, GetParam().part)) << outcome.err;
  // The line names the option once, at its start.
  if (GetParam().part.starts_with("--") && contains(GetParam().part, ": got ")) {
    EXPECT_TRUE(problem.starts_with(GetParam().part)) << outcome.err;
  }
  // CLI11 adds a line that points to --help.
  EXPECT_LE(outcome.problems().size(), 2U) << outcome.err;
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

Words run_with(const Words& rest) {
  Words arguments = {"run", kScene, "--out", "OUT"};
  arguments.insert(arguments.end(), rest.begin(), rest.end());
  return arguments;
}

const std::vector<Usage> kUsages = {
    {"NoCommand", {}, "command: got nothing, need one of check, run, render, schema, "},
    {"UnknownCommand", {"rum"}, "completion (nearest: run)"},
    {"UnknownOption", run_with({"--fast"}), "--fast"},
    {"RunWithoutScene", {"run", "--out", "OUT"}, "scene is required"},
    {"OutIsNothing", {"run", kScene, "--out", ""}, "--out: got \"\", need a path"},
    {"OutUnderProc",
     {"run", kScene, "--out", "/proc/handsim/out"},
     "/proc/handsim/out: got a folder that cannot be created"},
    {"FramesNegative", run_with({"--frames", "-1"}), "--frames: got -1, need a whole number"},
    {"FramesHalf", run_with({"--frames", "1.5"}), "--frames: got 1.5, need a whole number"},
    {"CheckOfNothing", {"check"}, "files is required"},
    {"RenderTimeNegative",
     {"render", kScene, "--out", "OUT.png", "--time", "-1"},
     "--time: got -1, need a time"},
    {"RenderTimeWord",
     {"render", kScene, "--out", "OUT.png", "--time", "noon"},
     "--time: got noon, need a time"},
    {"RenderTimeBeyond",
     {"render", kScene, "--out", "OUT.png", "--time", "1 h"},
     "--time: got 1 h, need a time"},
    {"RenderTimeAfterEnd",
     {"render", kScene, "--out", "OUT.png", "--time", "5 s"},
     "--time: got 5 s, need 0 to the scene's duration of 2 s"},
    {"RenderIntoNoFolder",
     {"render", kScene, "--out", "OUT/none/a.png"},
     ".png: got a file that cannot be created"},
    {"RenderAJpeg", {"render", kScene, "--out", "OUT.jpg"}, "need a name that ends in .png"},
    {"RenderWithoutEnding", {"render", kScene, "--out", "OUT"}, "need a name that ends in .png"},
    {"VideoOfAnUnknownKind",
     {"render", kScene, "--video", "OUT.avi"},
     "need a name that ends in .mp4 or .gif"},
    {"VideoTooFast",
     {"render", kScene, "--video", "OUT.gif", "--fps", "60"},
     "--fps: got 60, need above 0, at most 50"},
    {"VideoSpeedNone",
     {"render", kScene, "--video", "OUT.mp4", "--speed", "0"},
     "--speed: got 0, need a factor"},
    {"FpsWithoutVideo", run_with({"--fps", "30"}), "--fps requires --video"},
    {"GlUnknown", run_with({"--gl", "eg"}), "--gl: got eg, need one of osmesa, egl (nearest: egl)"},
    {"ExportOfNothing",
     {"export", "--out", "OUT.osim"},
     "scene: got nothing, need a scene file, or a person"},
    {"ExportOfBoth",
     {"export", kScene, "--out", "OUT.osim", "--stature", "1.7"},
     "need a scene or the options of a person, not both"},
    {"ExportEnding",
     {"export", kScene, "--out", "OUT.usd"},
     "need a name that ends in .xml or .mjcf (mjcf), .urdf (urdf), .osim (osim), .glb (glb)"},
    {"ExportSetWithoutScene",
     {"export", "--person", source("config/persons/child.yaml"), "--out", "OUT.osim", "--set", "duration=1"},
     "--set: got duration=1, need a scene"},
    {"ExportMusclesOfAScene",
     {"export", kScene, "--out", "OUT.osim", "--muscles"},
     "need a scene or the options of a person, not both"},
    {"ExportMusclesOfAPrototype",
     {"export", "--out", "OUT.osim", "--stature", "1.7", "--mass", "60", "--sex", "male", "--model",
      source("handmodels/prototype.yaml"), "--muscles"},
     "without muscles, need a hand model that has muscles"},
    {"ExportPersonSex",
     {"export", "--out", "OUT.osim", "--stature", "1.7", "--mass", "60"},
     "--sex: got nothing, need one of male, female, unknown"},
    {"ExportTimeOfAPerson",
     {"export", "--person", source("config/persons/child.yaml"), "--out", "OUT.xml", "--time", "1"},
     "--time: got 1 s, need a scene, and the format mjcf"},
    {"ExportTimeAsUrdf",
     {"export", kScene, "--out", "OUT.urdf", "--time", "1"},
     "--time: got 1 s, need a scene, and the format mjcf"},
    {"ExportTimeAfterEnd",
     {"export", kScene, "--out", "OUT.xml", "--time", "5 s"},
     "--time: got 5 s, need 0 to the scene's duration of 2 s"},
    {"ExportTimeWord",
     {"export", kScene, "--out", "OUT.xml", "--time", "noon"},
     "--time: got noon, need a time"},
    {"ExportFormat",
     {"export", kScene, "--format", "sdf", "--out", "OUT"},
     "--format: got sdf, need one of mjcf, urdf, osim, glb, usda, obj, stl, mcap"},
    {"SetWithoutEquals", run_with({"--set", "solver.step"}),
     "--set: got \"solver.step\", need key.path=value"},
    {"SetWithoutKey", run_with({"--set", "=1"}), "--set: got \"=1\", need key.path=value"},
    {"SetEmptyPart", run_with({"--set", "solver..step=1"}),
     "--set: got \"solver..step\", need a path of keys"},
    {"SetIndexBeyond", run_with({"--set", "hands.2.side=left"}),
     "--set hands.2.side: got \"2\" for a list of 2, need an index from 0 to 1"},
    {"SetIndexWord", run_with({"--set", "hands.first.side=left"}),
     "--set hands.first.side: got \"first\" for a list of 2"},
    {"SetThroughScalar", run_with({"--set", "title.x=1"}), "--set title.x: got \"x\" within two limp hands"},
    {"SetThroughNumber", run_with({"--set", "solver.step.deep=1"}),
     "--set solver.step.deep: got \"deep\" within \"1 ms\", need a path through mappings and lists"},
    {"SetUnknownKey", run_with({"--set", "solver.stepp=1"}),
     "--set solver.stepp:1:1: solver.stepp: got an unknown key"},
    {"SetWrongValue", run_with({"--set", "solver.step=fast"}),
     "--set solver.step:1:1: solver.step: got fast, need a time"},
    {"SetNothing", run_with({"--set", "solver.step="}), "solver.step: got nothing, need a time"},
    {"SetBrokenYaml", run_with({"--set", "effects=[gravity"}), "--set effects:1:"},
    {"SetInPersonFile", run_with({"--set", "hands.0.person.mass=-5"}),
     "hands.0.person.mass: got -5, need a mass"},
};

INSTANTIATE_TEST_SUITE_P(All, BadUsage, testing::ValuesIn(kUsages),
                         [](const auto& test) { return test.param.name; });

// A run that cannot write its video does not start: nothing is in the folder.
TEST(Video, WithoutFfmpegIsRefusedBeforeTheRun) {
  const TemporaryFolder folder;
  const std::string path = std::getenv("PATH");
  setenv("PATH", "/nonexistent", 1);
  const std::string video = (folder.path() / "v.mp4").string();
  const Outcome run =
      run_program({"run", kScene, "--out", (folder.path() / "out").string(), "--video", video});
  const Outcome render = run_program({"render", kScene, "--video", video});
  setenv("PATH", path.c_str(), 1);
  for (const Outcome& outcome : {run, render}) {
    EXPECT_EQ(outcome.status, 2);
    EXPECT_TRUE(outcome.err.starts_with("--video: got no program ffmpeg")) << outcome.err;
  }
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(Commands, AllInvalidOverridesAreReported) {
  const TemporaryFolder folder;
  const Outcome outcome = run_program({"run", kScene, "--out", (folder.path() / "out").string(), "--set",
                                       "title.x=1", "--set", "hands.9.side=left", "--set", "a"});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_EQ(outcome.problems().size(), 3U) << outcome.err;
}

TEST(Commands, AnOverrideTakesOneWord) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const Outcome outcome = run_program(
      {"run", "--set", "duration=10 ms", kScene, "--out", out.string(), "--set", "criteria={}", "--quiet"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_TRUE(fs::exists(out / "summary.json"));
}

TEST(Commands, AFileInTheFoldersPlaceIsLeftAlone) {
  const TemporaryFolder folder;
  const fs::path out = write(folder.path() / "out", "mine");
  const Outcome outcome = run_program({"run", kScene, "--out", out.string()});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_EQ(outcome.out, "");
  EXPECT_TRUE(contains(outcome.err, out.string() + ": got ")) << outcome.err;
  EXPECT_EQ(test::text_of(out), "mine");
}

TEST(Commands, CheckTellsGoodFilesFromBad) {
  const std::string person = source("config/persons/child.yaml"), model = source("handmodels/prototype.yaml");
  const std::string bad = source("tests/data/bad/person_missing_keys.yaml");
  const Outcome outcome = run_program({"check", kScene, bad, person, model, "/none.yaml"});
  EXPECT_EQ(outcome.status, 2);
  for (const std::string& good :
       {kScene + ": a scene, good", person + ": a person, good", model + ": a hand model, good"})
    EXPECT_TRUE(contains(outcome.out, good)) << outcome.out;
  EXPECT_FALSE(contains(outcome.out, bad));
  EXPECT_EQ(outcome.problems().size(), 3U) << outcome.err;
  EXPECT_EQ(run_program({"check", kScene, person, model}).status, 0);
}

// A hand model may say where it differs from another and nothing else.
TEST(Commands, CheckKnowsAHandModelByItsBase) {
  const TemporaryFolder folder;
  const std::string model =
      write(folder.path() / "mine.yaml", "based_on: " + source("handmodels/anatomical.yaml").string() + "\n");
  const Outcome outcome = run_program({"check", model});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_TRUE(contains(outcome.out, model + ": a hand model, good")) << outcome.out;
}

TEST(Commands, UncertainHandsHaveIntervals) {
  if (std::string_view(HANDSIM_PYTHON_PROGRAM).empty()) GTEST_SKIP() << "built without the Python package";
  const test::TemporaryFolder folder;
  const std::string out = (folder.path() / "out").string();
  const Outcome run = run_program({"run", source("config/two_hands.yaml"), "--set", "duration=0.02",
                                   "--engine", "articulated", "--uncertain", "4", "--out", out});
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_TRUE(contains(run.out, "nine in ten")) << run.out;
  const std::string command = test::text_of(folder.path() / "out/study.json");
  EXPECT_TRUE(contains(command, "--uncertain 4 --rollout {rollout}")) << command;
  const Outcome one =
      run_program({"run", source("config/two_hands.yaml"), "--set", "duration=0.02", "--engine",
                   "articulated", "--uncertain", "4", "--rollout", "2", "--out", out + "2"});
  EXPECT_EQ(one.status, 0) << one.err;
}

TEST(Commands, HelpIsNoErrorAndHasAnExample) {
  EXPECT_EQ(run_program({"--help"}).status, 0);
  for (const char* command : {"check", "run", "render"}) {
    const Outcome outcome = run_program({command, "--help"});
    EXPECT_EQ(outcome.status, 0);
    EXPECT_TRUE(contains(outcome.out, "Example: handsim " + std::string(command))) << outcome.out;
  }
}

// Oracle: the contract: like --set solver.engine, before any --set.
TEST(EngineOption, SwitchesEnginesAndSaysWhatWasLeftOut) {
  const TemporaryFolder folder;
  const auto run_on = [&](std::vector<std::string> more) {
    std::vector<std::string> words = {
        "run",   kScene,       "--out", (folder.path() / "out").string(), "--json", "--set", "duration=10 ms",
        "--set", "criteria={}"};
    words.insert(words.end(), more.begin(), more.end());
    return run_program(words);
  };
  const Outcome switched = run_on({"--engine", "articulated"});
  EXPECT_EQ(switched.status, 0) << switched.err;
  EXPECT_TRUE(contains(switched.out, "\"method\": \"semi_implicit_euler\"")) << switched.out;
  EXPECT_TRUE(contains(switched.err, "left out: engine articulated does not have them")) << switched.err;
  const Outcome method =
      run_on({"--set", "solver.method=euler_projected", "--set", "effects=[gravity]", "--engine", "dae"});
  EXPECT_TRUE(contains(method.out, "\"method\": \"euler_projected\"")) << method.err;
  const Outcome refused = run_on({"--engine", "dae"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_TRUE(contains(refused.err, "effects: got joint_stops")) << refused.err;
  EXPECT_EQ(run_on({"--engine", "bullet"}).status, 2);
}

// Oracle: the forms that git and pkg-config write.
TEST(Commands, VersionNamesCommitCompilerAndTheBuildOfOde) {
  const Outcome outcome = run_program({"--version"});
  EXPECT_EQ(outcome.status, 0);
  const std::regex form(
      "handsim [0-9.]+, commit (unknown|[0-9a-f]{7,40}(-dirty)?)\n(GNU|Clang) [0-9.]+, [A-Za-z]+\n"
      "ODE 0\\.[0-9.]+, double precision\narticulated engine, [a-z0-9 ]+( \\([A-Z0-9-]+\\))?\n");
  EXPECT_TRUE(std::regex_match(outcome.out, form)) << outcome.out;
}

// A ball in a gravity of 1000 m/s2 passes the engine's limit of 1000 m/s after 1 s.
TEST(Divergence, GivesStatusOneThePlaceAndCompleteFiles) {
  const TemporaryFolder folder;
  const fs::path scene = write(
      folder.path() / "fall.yaml",
      std::string(test::kBallScene) + "effects: [gravity]\ngravity: [0, 0, -1000]\nrecord: {every: 0.01}\n");
  const fs::path out = folder.path() / "out";
  const Outcome outcome = run_program({"run", scene.string(), "--out", out.string()});
  EXPECT_EQ(outcome.status, 1);
  ASSERT_EQ(outcome.problems().size(), 1U) << outcome.err;
  EXPECT_TRUE(outcome.problems()[0].starts_with("at t = 1.001 s: ball: speed [m/s]: 1001 is beyond 1000"))
      << outcome.err;
  const std::string trajectory = test::text_of(out / "trajectory.csv");
  EXPECT_TRUE(trajectory.ends_with('\n'));
  // A head, and rows from 0 to 1 s.
  EXPECT_EQ(std::count(trajectory.begin(), trajectory.end(), '\n'), 102);
  EXPECT_TRUE(contains(test::text_of(out / "summary.json"), "speed [m/s]"));
  EXPECT_TRUE(fs::exists(out / "resolved.yaml"));
  for (const auto& entry : fs::directory_iterator(out)) EXPECT_NE(entry.path().extension(), ".part");
}

TEST(Criteria, ThatFailGiveStatusOne) {
  const TemporaryFolder folder;
  const Outcome outcome = run_program({"run", kScene, "--out", (folder.path() / "out").string(), "--set",
                                       "duration=20 ms", "--set", "criteria.joint_gap=0"});
  EXPECT_EQ(outcome.status, 1) << outcome.err;
  EXPECT_TRUE(contains(outcome.out, "FAILED")) << outcome.out;
}

}  // namespace
}  // namespace handsim
